"""What a scene is made of: rational patches, or indexed triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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
