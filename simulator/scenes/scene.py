"""A scene: patches or triangles, and the cameras that they are known by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from simulator.scenes.camera import Camera


@dataclass(frozen=True)
class Patches:
    """Rational bicubic Bezier patches.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous control points (wx, wy, wz, w), point 4 * row + column; u runs along the columns, v along the rows.
    """

    points: NDArray[np.float32]


@dataclass(frozen=True)
class Mesh:
    """Indexed triangles.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Model space with w = 1, or clip space where ``clip_space`` is set.
    triangles : ndarray, (F, 3), int32
    colors : ndarray, (V, 4), float32, or None
        Linear RGBA in [0, 1] a vertex.
    normals : ndarray, (V, 3), float32, or None
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colors: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    clip_space: bool = False


@dataclass(frozen=True)
class Scene:
    """What a pipeline draws: ``patches`` or a ``mesh`` (or both), and named ``views``."""

    name: str
    patches: Patches | None = None
    mesh: Mesh | None = None
    views: Mapping[str, Camera] = field(default_factory=dict)
    note: str = ""  # says so where the scene is a stand-in
