"""A reference for users of nvdiffrast: its CUDA rasterizer on NumPy arrays, without a GPU."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.bin_raster import bin_raster
from tilestamp.simulator.stages.laine2011.coarse_raster import coarse_raster
from tilestamp.simulator.stages.laine2011.fine_raster import fine_raster
from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics
from tilestamp.simulator.stages.laine2011.triangle_setup import MAX_SIZE, MAX_SUBTRIANGLES, triangle_setup


def rasterize(pos: NDArray[np.float32], tri: NDArray[np.int32], resolution: tuple[int, int]) -> NDArray[np.float32]:
    """Rasterize triangles as ``nvdiffrast.torch.rasterize`` with ``RasterizeCudaContext`` does.

    Parameters
    ----------
    pos : ndarray, (B, V, 4), float32
        Clip positions of each image of the batch.
    tri : ndarray, (F, 3), int32
        Vertex indices. A triangle with an index out of range is not drawn, as in the original.
    resolution : tuple of int
        Height and width in pixels, at most 2048 each.

    Returns
    -------
    ndarray, (B, H, W, 4), float32
        u, v, z/w and triangle index + 1; zeros where nothing was drawn; row 0 at y = -1. u and v weigh vertices 0 and
        1, perspective-correct. Indices are exact; of equal depths the later triangle shows. u, v and z/w are
        evaluated in float64 and rounded.

    Raises
    ------
    TilestampError
        For other shapes, types or sizes.
    """
    height, width = _check(pos, tri, resolution)
    tri = np.ascontiguousarray(tri)
    out = np.zeros((len(pos), height, width, 4), np.float32)
    for image, positions in zip(out, pos, strict=True):
        positions = np.ascontiguousarray(positions)  # noqa: PLW2901 - the same values
        ids = _triangle_ids(positions, tri, width, height)
        image[..., :3] = pixel_barycentrics(ids, positions, tri)
        image[..., 3] = ids + 1
    return out


def _triangle_ids(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], width: int, height: int
) -> NDArray[np.int32]:
    """Draw one image; triangle index of each pixel, -1 for none."""
    simt = Simt()
    capacity = MAX_SUBTRIANGLES
    setup, _, _ = triangle_setup(
        positions, triangles, width, height, simt, release="nvdiffrast", counting=False, capacity=capacity
    )
    bins, _, _ = bin_raster(setup, width, height, simt, release="nvdiffrast", counting=False)
    tiles, _, _ = coarse_raster(bins, setup, width, height, simt, release="nvdiffrast", counting=False)
    buffers, _, _ = fine_raster(
        setup, tiles.starts, tiles.entries, tiles.active, width, height, simt, release="nvdiffrast", counting=False
    )
    return buffers.ids[0, :height, :width]


def _check(pos: object, tri: object, resolution: Iterable[int]) -> tuple[int, int]:
    """Refuse what the original refuses; returns height and width."""
    if not isinstance(pos, np.ndarray) or pos.dtype != np.float32 or pos.ndim != 3 or pos.shape[2] != 4:
        raise TilestampError(f"pos must be a float32 array [B, V, 4], not {_describe(pos)}")
    if not isinstance(tri, np.ndarray) or tri.dtype != np.int32 or tri.ndim != 2 or tri.shape[1] != 3:
        raise TilestampError(f"tri must be an int32 array [F, 3], not {_describe(tri)}")
    if 0 in (*pos.shape, *tri.shape):
        raise TilestampError(f"pos {pos.shape} and tri {tri.shape} must not be empty")
    try:
        height, width = (int(n) for n in resolution)
    except (TypeError, ValueError):
        raise TilestampError(f"resolution must be (height, width), not {resolution!r}") from None
    if not (1 <= height <= MAX_SIZE and 1 <= width <= MAX_SIZE):
        raise TilestampError(f"resolution {height}x{width}: the original draws 1 to {MAX_SIZE} pixels along an axis")
    return height, width


def _describe(value: object) -> str:
    return f"{value.dtype} {list(value.shape)}" if isinstance(value, np.ndarray) else type(value).__name__
