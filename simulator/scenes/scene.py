"""A scene: patches or triangles, and the cameras that they are known by."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.camera import Camera


@dataclass(frozen=True)
class Patches:
    """Rational bicubic Bezier patches.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous control points (wx, wy, wz, w), point 4 * row + column; u runs along the columns, v along the rows.
        All are finite and every w is positive: anything else is refused.
    """

    points: NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.points.ndim != 3 or self.points.shape[1:] != (16, 4) or not len(self.points):
            raise TilestampError(f"patches: control points must be (P, 16, 4), not {self.points.shape}")
        broken = ~np.isfinite(self.points).all(axis=(1, 2))
        if broken.any():
            raise TilestampError(f"patches: patch {int(broken.argmax())} has a control point that is NaN or infinite")
        light = (self.points[:, :, 3] <= 0.0).any(axis=1)
        if light.any():
            raise TilestampError(f"patches: patch {int(light.argmax())} has a weight that is not positive")


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
    uvs : ndarray, (V, 2), float32, or None
        Texture coordinates, v from the top row down; they wrap outside [0, 1].
    texture_ids : ndarray, (F,), int32, or None
        Texture of each triangle, -1 where it has none.
    textures : tuple of ndarray, (H, W, 4), uint8
    draws : ndarray, (D, 2), int64, or None
        Vertices and triangles of each part that its file has drawn by itself, in order; one part where None.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colors: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    clip_space: bool = False
    uvs: NDArray[np.float32] | None = None
    texture_ids: NDArray[np.int32] | None = None
    textures: tuple[NDArray[np.uint8], ...] = ()
    draws: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class Scene:
    """What a pipeline draws: ``patches`` or a ``mesh`` (or both), and named ``views``."""

    name: str
    patches: Patches | None = None
    mesh: Mesh | None = None
    views: Mapping[str, Camera] = field(default_factory=dict)
    note: str = ""  # says so where the scene is a stand-in

    @classmethod
    def from_clip_space(cls, positions: ArrayLike, triangles: ArrayLike, name: str = "clip-space mesh") -> "Scene":
        """Make a scene of clip-space positions (V, 4) and triangles (F, 3), which go straight to triangle setup.

        Raises TilestampError where positions are not finite, triangles name vertices that do not exist, or are none.
        """
        from tilestamp.simulator.scenes.clip_space import clip_space_mesh, clip_space_scene

        return clip_space_scene(clip_space_mesh(positions, triangles, name), name)

    @classmethod
    def sweep(cls, area: float, width: int = 1024, height: int = 768, seed: int = 0) -> "Scene":
        """Make the synthetic triangles of one area, in pixels, of Figure 5 (Laine & Karras 2011); see `sweep`."""
        from tilestamp.simulator.scenes.clip_space import clip_space_scene
        from tilestamp.simulator.scenes.sweep import sweep_mesh

        return clip_space_scene(sweep_mesh(area, width, height, seed), f"sweep {area:g} px")
