"""Micropolygons where numbers are wanted within an error: part of the tiles and blocks run, and no picture is drawn.

Bound and split runs in full: how many sub-patches there are, and where, is what all else hangs on. Only those that a
sampled tile or block needs are diced; none is shaded.
"""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.sampler import Sampler
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.bucket_count import (
    BLOCK,
    BucketCountEvent,
    address_work,
    bucket_count,
    init_work,
)
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write, write_streams
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import dice_work
from tilestamp.simulator.stages.eisenacher2010.sampled_tiles import TileSizes, meeting, tile_sizes
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import raster_streams, tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import block_shape
from tilestamp.simulator.work import Work

NOWHERE = np.array([np.inf, np.inf, -np.inf, -np.inf], np.float32)  # box of a lane whose sub-patch is not diced
CHUNK_WORDS = 8  # counters in 32 bytes


class _Split(NamedTuple):
    """What bound and split left, and the view."""

    points: NDArray[np.float32]
    subpatches: SubPatches
    boxes: NDArray[np.float32]
    matrix: ArrayLike
    width: int
    height: int
    simt: Simt

    def dice(self, some: NDArray[np.int64]) -> Any:
        """Grids of some sub-patches, in their order, without colour."""
        found = self.subpatches
        part = SubPatches(found.patch[some], found.level[some], found.i[some], found.j[some], found.passes)
        view = (self.matrix, self.width, self.height, self.simt)
        return dice(self.points, part, *view, counting=False, shaded=False)[0]


def sampled_back_end(
    sample: Sampler,
    points: NDArray[np.float32],
    subpatches: SubPatches,
    boxes: NDArray[np.float32],
    view: tuple[ArrayLike, int, int, Simt],
    tiles: Tiles,
    *,
    textured: bool,
    raster: dict[str, Any],
) -> list[Work]:
    """Dice, bucket and rasterize part of the sub-patches.

    Parameters
    ----------
    sample : Sampler
    points : ndarray, (P, 16, 4), float32
    subpatches : SubPatches
    boxes : ndarray, (N, 5), float32
        From ``bound_and_split``.
    view : tuple
        Matrix, width, height and the machine's shape.
    tiles : Tiles
    textured : bool
    raster : dict
        Options of ``tile_raster``.
    """
    split = _Split(points, subpatches, boxes, *view)
    simt = split.simt
    sizes = tile_sizes(boxes, tiles)
    count = sizes.boxes.astype(np.uint32)
    start, scanned = bucket_scan(count, simt)
    drawn = int(np.count_nonzero(sizes.meets))
    shape = block_shape(
        tiles.size, raster["spp"], simt, box_tests=raster["box_tests"], loaded=raster["edges"] == "loaded"
    )
    diced = dice_work(subpatches.patch, len(points), textured, simt)
    counted, written = _buckets(sample, split, tiles, sizes, count, start)
    rastered = sample.stage(
        sizes.boxes,
        partial(_draw, split, tiles, raster),
        lambda table: raster_streams(table, int(count.sum(dtype=np.int64)), drawn, shape, simt),
        (sizes.area, sizes.box_area),
    )
    return [diced, init_work(tiles, 1, simt), counted, *scanned, written, rastered]


def _draw(split: _Split, tiles: Tiles, raster: dict[str, Any], units: NDArray[np.int64]) -> Work:
    """Tiles ``units``, with the grids that they need, in the order in which the warps of all sub-patches list them."""
    some, simt = meeting(split.boxes, tiles, units), split.simt
    grids = split.dice(some)
    warps, warp = np.unique(some // simt.warp, return_inverse=True)
    place = warp * simt.warp + some % simt.warp  # each in its own lane: the order within a warp goes by slots
    boxes = np.full((len(warps) * simt.warp, 4), NOWHERE, np.float32)
    boxes[place] = grids.boxes
    grid = np.zeros(len(boxes), np.uint32)
    grid[place] = np.arange(len(some))
    count, idx, _ = bucket_count(boxes, tiles, simt, counting=False)
    start, _ = bucket_scan(count, simt, counting=False)
    lists, _ = bucket_write(boxes, tiles, count, start, idx, simt, counting=False)
    size = split.width, split.height
    return tile_raster(grids.vertices, count, start, grid[lists], tiles, *size, simt, only=units, **raster)[3][0]


class _Buckets(NamedTuple):
    """Boxes of the diced sub-patches of blocks of the bucketing kernels; those of other blocks are not there yet."""

    boxes: NDArray[np.float32]  # (N, 4)
    diced: NDArray[np.bool_]  # (blocks,)

    def of(self, split: _Split, blocks: NDArray[np.int64]) -> NDArray[np.float32]:
        """Boxes of some blocks, one after another."""
        new = _entries(blocks[~self.diced[blocks]], len(self.boxes))
        if len(new):
            self.boxes[new] = split.dice(new).boxes
        self.diced[blocks] = True
        found: NDArray[np.float32] = self.boxes[_entries(blocks, len(self.boxes))]
        return found


def _entries(blocks: NDArray[np.int64], patches: int) -> NDArray[np.int64]:
    """Sub-patches of blocks."""
    entries: NDArray[np.int64] = (blocks[:, None] * BLOCK + np.arange(BLOCK)).ravel()
    return entries[entries < patches]


def _buckets(
    sample: Sampler, split: _Split, tiles: Tiles, sizes: TileSizes, count: NDArray[np.uint32], start: NDArray[np.uint32]
) -> tuple[Work, Work]:
    """Address calculation and bucket write of part of the blocks of 256 sub-patches; the same ones at first."""
    patches, simt = len(split.boxes), split.simt
    blocks = -(-patches // BLOCK)
    buckets = _Buckets(np.empty((patches, 4), np.float32), np.zeros(blocks, np.bool_))
    met = np.add.reduceat(sizes.meets.astype(np.int64), np.arange(0, patches, BLOCK))

    def calculate(units: NDArray[np.int64]) -> Work:
        order = np.argsort(units)  # a block that is not full comes last
        work = bucket_count(buckets.of(split, units[order]), tiles, simt)[2][1]
        return replace(work, table=work.table[np.argsort(order)])

    def write(units: NDArray[np.int64]) -> Work:
        order = np.argsort(units)
        boxes = buckets.of(split, units[order])
        idx = bucket_count(boxes, tiles, simt, counting=False)[1]
        work = bucket_write(boxes, tiles, count, start, idx, simt)[1][0]
        return replace(work, table=work.table[np.argsort(order)])

    key = sample.stages
    counted = sample.stage(met, calculate, key=key)
    requests = _requests(counted, count)
    exact = address_work(patches, tiles, counted.table, requests, aggregate=False)
    counted = replace(exact, sample=counted.sample)
    written = sample.stage(met, write, lambda table: write_streams(table, patches, tiles, count), key=key)
    return counted, written


def _requests(counted: Work, count: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Atomic requests by 32 bytes of counters: as many for each patch of a list as on the whole."""
    E = BucketCountEvent
    share = counted.total(E.ATOMIC_REQUESTS) / max(int(count.sum(dtype=np.int64)), 1)
    lists = np.add.reduceat(count.astype(np.float64), np.arange(0, len(count), CHUNK_WORDS))
    requests: NDArray[np.int64] = np.rint(lists * share).astype(np.int64)
    return requests
