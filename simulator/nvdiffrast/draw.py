"""One image: which triangle shows at each pixel, by the four kernels of CudaRaster, in one viewport or several."""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.bin_raster import bin_raster
from tilestamp.simulator.stages.laine2011.coarse_raster import coarse_raster
from tilestamp.simulator.stages.laine2011.exact import fma
from tilestamp.simulator.stages.laine2011.fine_raster import fine_raster
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX
from tilestamp.simulator.stages.laine2011.triangle_setup import MAX_SIZE, MAX_SUBTRIANGLES, triangle_setup

Clip = Literal["2025", "2024"]
"""Which triangles are left whole: those inside the frustum (0.3.4 and later), or also those that leave it by less than
the guard band (0.3.3 and before)."""

TILE = 8  # pixels
UNCOUNTED = Executor(counting=False)
_PART_VERTICES = 4096  # at least


class Layer(NamedTuple):
    """Which triangle shows, and its depth."""

    ids: NDArray[np.int32]  # (H, W) triangle, -1 for none
    depths: NDArray[np.uint32]  # (H, W) fixed point, DEPTH_MAX where nothing was drawn


def draw(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    height: int,
    width: int,
    clip: Clip = "2025",
    behind: NDArray[np.uint32] | None = None,
    execute: Executor = UNCOUNTED,
    simt: Simt = Simt(),  # noqa: B008 - frozen
) -> Layer:
    """Draw one image.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    height, width : int
        Pixels. An axis of more than 2048 is divided into viewports.
    clip : {"2025", "2024"}
    behind : ndarray, (H, W), uint32, optional
        Depths of the layer before: only what lies behind them is drawn (depth peeling).
    execute : Executor
        Counts what the kernels do, or not.
    simt : Simt
        The shape of the machine to count for.

    Returns
    -------
    Layer
    """
    columns, rows = list(viewports(width)), list(viewports(height))
    if len(columns) == len(rows) == 1:
        return _draw_viewport(positions, triangles, height, width, clip, behind, execute, simt)
    layer = Layer(np.full((height, width), -1, np.int32), np.full((height, width), DEPTH_MAX, np.uint32))
    for y, tile_height in rows:
        for x, tile_width in columns:
            tile = np.s_[y : y + tile_height, x : x + tile_width]
            moved = through_viewport(positions, (width, height), (x, y), (tile_width, tile_height))
            before = None if behind is None else behind[tile]
            shown = _draw_viewport(moved, triangles, tile_height, tile_width, clip, before, execute, simt)
            layer.ids[tile], layer.depths[tile] = shown
    return layer


def viewports(pixels: int) -> Iterator[tuple[int, int]]:
    """First pixel and size of the viewports along an axis: as few as hold 2048, of whole tiles, the last shorter."""
    whole = _whole_tiles(pixels)
    size = _whole_tiles(-(-whole // -(-whole // MAX_SIZE)))
    for first in range(0, pixels, size):
        yield first, min(size, pixels - first)


def _whole_tiles(pixels: int) -> int:
    return -(-pixels // TILE) * TILE


@kernel(error_model="numpy")
def _move_part(part: int, parts: int, positions: Any, scales: Any, shifts: Any, out: Any) -> None:
    for v in range(len(positions) * part // parts, len(positions) * (part + 1) // parts):
        w = positions[v, 3]
        out[v, 0] = fma(positions[v, 0], scales[0], w * shifts[0])
        out[v, 1] = fma(positions[v, 1], scales[1], w * shifts[1])
        out[v, 2], out[v, 3] = positions[v, 2], w


def through_viewport(
    positions: NDArray[np.float32], whole: tuple[int, int], first: tuple[int, int], size: tuple[int, int]
) -> NDArray[np.float32]:
    """Clip positions as a viewport of ``size`` pixels at pixel ``first`` of the ``whole`` sees them."""
    n, at, s = (np.array(pair, np.float32) for pair in (whole, first, size))
    out = np.empty_like(positions)
    with np.errstate(all="ignore"):
        parts = parts_of(len(positions), _PART_VERTICES)
        for_parts(_move_part, parts, positions, n / s, (n - s - 2 * at) / s, out)
    return out


def _draw_viewport(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    height: int,
    width: int,
    clip: Clip,
    behind: NDArray[np.uint32] | None,
    execute: Executor,
    simt: Simt,
) -> Layer:
    shape: dict[str, Any] = {"width": width, "height": height, "simt": simt, "release": "nvdiffrast"}
    whole: dict[str, Any] = {"guard_band": clip == "2024", "interpolate": False, "capacity": MAX_SUBTRIANGLES}
    setup, _, _ = execute(triangle_setup, positions, triangles, **shape, **whole)
    queues, _, _ = execute(bin_raster, setup, **shape)
    lists, _, _ = execute(coarse_raster, queues, setup, **shape)
    buffers, _, _ = execute(fine_raster, setup, lists.starts, lists.entries, lists.active, **shape, behind=behind)
    return Layer(buffers.ids[0, :height, :width], buffers.depth[0, :height, :width])
