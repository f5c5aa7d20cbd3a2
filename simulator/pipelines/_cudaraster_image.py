"""From cudaraster's buffers to a frame: colours, the sample shown, heat maps by tile."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.coarse_raster import TileQueues
from tilestamp.simulator.stages.laine2011.fine_raster_queue import FineRasterEvent
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers
from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics
from tilestamp.simulator.stages.laine2011.triangle_setup import Release
from tilestamp.simulator.work import Work

_PART_ROWS = 32  # that one call of the worker takes, at least


@kernel(lent=True)
def _unpack_part(part: int, parts: int, color: Any, image: Any) -> None:
    """Red, green and blue of a share of the rows; ``color`` has row 0 at the bottom."""
    height, width = image.shape[:2]
    for row in range(height * part // parts, height * (part + 1) // parts):
        packed, channels = color[height - 1 - row], image[row].reshape(3 * width)
        for x in range(width):
            word = packed[x]
            channels[3 * x], channels[3 * x + 1], channels[3 * x + 2] = word & 255, word >> 8 & 255, word >> 16 & 255


def frame_image(
    buffers: FrameBuffers,
    width: int,
    height: int,
    release: Release,
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    colors: NDArray[np.float32] | None,
) -> NDArray[np.uint8]:
    """Colours of all pixels, (H, W, 3) uint8, row 0 on top; samples are averaged."""
    if release == "nvdiffrast" and colors is not None:  # it draws triangle numbers; colours are found afterwards
        ids = np.ascontiguousarray(buffers.ids[0, :height, :width])
        weights = pixel_barycentrics(ids, positions, triangles)[..., :2]
        weights = np.concatenate([weights, 1 - weights.sum(axis=-1, keepdims=True)], axis=-1)
        corners = colors[triangles[np.maximum(ids, 0)], :3]
        shaded = np.einsum("hwk,hwkc->hwc", weights, corners) * (ids >= 0)[..., None]
        picture: NDArray[np.uint8] = np.clip(shaded * 255 + 0.5, 0, 255).astype(np.uint8)
        return picture[::-1]
    samples = len(buffers.color)
    if samples == 1:
        image = np.empty((height, width, 3), np.uint8)
        for_parts(_unpack_part, parts_of(height, _PART_ROWS), buffers.color[0], image)
        return image
    packed = np.ascontiguousarray(buffers.color[:, :height, :width][:, ::-1])
    bytes_ = packed.view(np.uint8).reshape(samples, height, width, 4)[..., :3]
    total = bytes_.sum(axis=0, dtype=np.uint16)
    mean: NDArray[np.uint8] = ((2 * total + samples) // (2 * samples)).astype(np.uint8)  # rounded to nearest
    return mean


def tile_maps(maps: dict[str, NDArray[np.int64]], tiles: TileQueues, fine: Work | None) -> None:
    """Add one draw to the heat maps, a cell a tile, row 0 on top."""
    shape = (tiles.tiles_y, tiles.tiles_x)
    _add(maps, "tile_triangles", np.diff(tiles.starts).reshape(shape))
    if fine is None:
        return
    for name, event in (("tile_fragments", FineRasterEvent.FRAGMENT_LANES), ("tile_z_kills", FineRasterEvent.Z_KILLS)):
        cells = np.zeros(shape[0] * shape[1], np.int64)
        cells[tiles.active] = fine.table[:, event]
        _add(maps, name, cells.reshape(shape))


def _add(maps: dict[str, NDArray[np.int64]], name: str, cells: NDArray[np.int64]) -> None:
    maps[name] = cells[::-1] + maps.get(name, 0)
