"""Shading after visibility: only grids of which a quad is seen are shaded (not in Eisenacher & Loop 2010).

Dicing leaves positions alone, and the tile raster the number of the quad that each pixel sees. Then a thread a pixel
marks the grid that it sees; marks are scanned, and the numbers of marked grids listed; these are diced again, for their
colours; and a thread a pixel blends the colours of its quad. One sample a pixel.
"""

from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.counters import count, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import LINE_BYTES, Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import BlockShape, block_shape
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import (
    BACKGROUND,
    COLUMN,
    TOGETHER,
    add_tests,
    color_of,
    new_tests,
    run_tests,
)
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.work import Work

BLOCK = 256  # threads, a pixel or a grid each
STAGE = "shade_visible"
WORD_BYTES, VECTOR_BYTES = 4, 16


@shown(count("SEEN_LANES", "pixels that see a quad"))
class PixelEvent(IntEnum):
    """Events of one block: a thread a pixel."""

    WARPS = 0  # load the number of a quad
    WARP_LANES = 1
    SEEN_WARPS = 2  # with a quad in at least one lane: mark its grid, or blend the colours of its vertices
    SEEN_LANES = 3
    LOAD_TRANSACTIONS = 4
    LOAD_BYTES = 5
    STORE_TRANSACTIONS = 6
    STORE_BYTES = 7


_E = PixelEvent


@kernel
def _blend(part: int, parts: int, ids: Any, points: Any, words: Any, shape: BlockShape, image: Any) -> None:
    """Colours of the pixels of some rows: each quad is evaluated again at the one sample that sees it."""
    height, width = ids.shape
    tests = new_tests()
    for y in range(height * part // parts, height * (part + 1) // parts):
        for first in range(0, width, TOGETHER):
            number = np.uint64(0)
            for x in range(first, min(first + TOGETHER, width)):
                if ids[y, x] != BACKGROUND:
                    number = add_tests(tests, number, np.uint64(ids[y, x]), (x, x, 0, 0))
                for channel in range(3):
                    image[y, x, channel] = (BACKGROUND >> np.uint32(8 * channel)) & np.uint32(255)
            run_tests(tests, np.int64(number), points, None, (0, y), shape)
            for k in range(np.int64(number)):
                color, x = color_of(tests, np.uint64(k), words, np.uint64(shape.grid)), int(tests.rows[COLUMN + k])
                for channel in range(3):
                    image[y, x, channel] = (color >> np.uint32(8 * channel)) & np.uint32(255)


@kernel
def _count(ids: Any, offsets: Any, vertices_a_grid: int, warp: int, coalescing: int, table: Any) -> None:
    """Events of a kernel that loads the vertices at ``offsets`` of each quad seen; with one alone it marks the grid."""
    addresses, blending = np.empty(warp, np.int64), offsets.size > 1
    for first in range(0, ids.size, warp):
        lanes, row, seen = min(warp, ids.size - first), table[first // BLOCK], 0
        for lane in range(lanes):
            seen += ids[first + lane] != BACKGROUND
        row[_E.WARPS] += 1
        row[_E.WARP_LANES] += lanes
        row[_E.SEEN_WARPS] += seen > 0
        row[_E.SEEN_LANES] += seen
        pixels, pixel_bytes = contiguous(first * WORD_BYTES, lanes * WORD_BYTES, coalescing)
        row[_E.LOAD_TRANSACTIONS] += pixels
        row[_E.LOAD_BYTES] += pixel_bytes
        if blending:
            row[_E.STORE_TRANSACTIONS] += pixels
            row[_E.STORE_BYTES] += pixel_bytes
        for access in range(offsets.size):
            for lane in range(lanes):
                at = np.int64(ids[first + lane])
                vertex, mark = (at + offsets[access]) * VECTOR_BYTES, at // vertices_a_grid * WORD_BYTES
                at = vertex if blending else mark
                addresses[lane] = at if ids[first + lane] != BACKGROUND else -1
            moved, size = transactions(addresses, lanes, VECTOR_BYTES if blending else WORD_BYTES, coalescing)
            if blending:
                row[_E.LOAD_TRANSACTIONS] += moved
                row[_E.LOAD_BYTES] += size
            else:
                row[_E.STORE_TRANSACTIONS] += moved
                row[_E.STORE_BYTES] += size


def dice_positions(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    *,
    side: GridSide = 4,
) -> StageResult[Grids]:
    """Evaluate the vertices of grids, and shade none; as ``dice``."""
    grids, works, _ = dice(points, subpatches, matrix, width, height, simt, shaded=False, side=side)
    return StageResult(grids, tuple(replace(work, variant="positions") for work in works))


def shade_visible(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    grids: Grids,
    ids: NDArray[np.uint32],
    matrix: ArrayLike,
    simt: Simt,
    *,
    side: GridSide = 4,
    texture: NDArray[np.uint8] | None = None,
) -> StageResult[NDArray[np.uint8]]:
    """Shade the grids that are seen, and the pixels that see them.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Control points of the urPatches.
    subpatches : SubPatches
    grids : Grids
        Their positions.
    ids : ndarray, (H, W), uint32
        Number of the first vertex of the quad that each pixel sees, from ``tile_raster``.
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    simt : Simt
    side : int
        Vertices a side of a grid.
    texture : ndarray, optional
        As for ``dice``.

    Returns
    -------
    outputs : ndarray, (H, W, 3), uint8
        The picture that grids shaded beforehand give, bit for bit.
    works : marking, scan, list, colours and blending
    facts : shaded_vertices
    """
    height, width = ids.shape
    marks = np.zeros(len(grids.vertices), np.uint32)
    marks[ids[ids != BACKGROUND] // side**2] = 1
    _, scan, _ = bucket_scan(marks, simt)
    kept = np.flatnonzero(marks)
    patch, level, i, j, passes = subpatches
    some = SubPatches(patch[kept], level[kept], i[kept], j[kept], passes)
    shaded, dicing, _ = dice(points, some, matrix, width, height, simt, texture=texture, side=side)
    vertices = grids.vertices.copy()
    vertices[kept, :, 3] = shaded.vertices[:, :, 3]
    image = np.empty((height, width, 3), np.uint8)
    shape, points = block_shape(8, 1, simt, box_tests=True, loaded=False, grid=side), vertices.reshape(-1)
    for_parts(_blend, parts_of(height), ids, points, points.view(np.uint32), shape, image)
    works = (
        pixel_work("mark_grids", ids, side, np.array([0]), len(marks), simt),
        *_renamed(scan),
        thread_per_item(
            STAGE, "list_grids", len(marks), BLOCK, simt,
            (Access("marks", WORD_BYTES, 1), Access("places", WORD_BYTES, 1)), (Access("seen grids", WORD_BYTES, 1),),
        ),
        *(_colors_alone(work) for work in dicing),
        pixel_work("blend_pixels", ids, side, np.array([0, 1, side, side + 1]), len(marks), simt),
    )  # fmt: skip
    return StageResult(image, works, {"shaded_vertices": len(kept) * side**2})


def _renamed(scan: tuple[Work, ...]) -> tuple[Work, ...]:
    """The scan of bucketing, of marks."""
    names: dict[str, Any] = {"COUNT": "marks", "START": "places"}
    return tuple(
        replace(
            work, stage=STAGE,
            streams=tuple(replace(stream, buffer=names.get(stream.buffer, stream.buffer)) for stream in work.streams),
        )
        for work in scan
    )  # fmt: skip


def _colors_alone(work: Work) -> Work:
    """Dicing that stores the colour alone of each vertex: as many segments as the whole vertices, each in part."""
    streams = tuple(
        replace(stream, partial_lines=stream.bytes // LINE_BYTES) if stream.buffer == "grids" else stream
        for stream in work.streams
        if stream.buffer != "boxes"
    )
    return replace(work, stage=STAGE, variant="colours", streams=streams)


def pixel_work(
    name: str, ids: NDArray[np.uint32], side: int, offsets: NDArray[np.int64], grids: int, simt: Simt
) -> Work:
    """Work of a kernel with a thread a pixel."""
    table = np.zeros((-(-ids.size // BLOCK), len(_E)), np.int64)
    _count(ids.reshape(-1), offsets, side**2, simt.warp, int(simt.coalescing), table)
    total, pixels = table.sum(axis=0), ids.size * WORD_BYTES
    seen = len(np.unique(ids[ids != BACKGROUND] // side**2))
    loaded, stored = int(total[_E.LOAD_BYTES]), int(total[_E.STORE_BYTES])
    streams = [Stream("quad numbers", "load", pixels, pixels)]
    if len(offsets) > 1:
        streams.append(Stream("grids", "load", loaded - pixels, seen * side**2 * VECTOR_BYTES))
        streams.append(Stream("framebuffer", "store", stored, pixels, partial_lines=0))
    else:
        streams.append(Stream("marks", "store", stored, grids * WORD_BYTES))
    return Work(stage=STAGE, kernel=name, events=_E, table=table, grid=len(table), block=BLOCK, streams=tuple(streams))
