"""Fine raster, the tile in hand: pixels in shared memory and a queue of fragments (Laine & Karras 2011, section 6)."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.bits import popcount
from tilestamp.models.coalescing import contiguous, smallest_transaction_bytes, transactions
from tilestamp.models.counters import distribution, shown
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.coverage import pixel_mask, square_mask
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.stages.prefetch import prefetch
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS

TILE = 8  # pixels
PIXELS = TILE * TILE
SEGMENT = 32  # entries of a tile's list that are read together
QUEUE = 64  # triangles with fragments left
WARP = 32
ENTRY_BYTES = 4
HEADER_BYTES = 16
_AHEAD = 16  # entries, that memory is asked for before it is read


@shown(*SAMPLE_COUNTERS, distribution("triangles", "ENTRY_LANES", "triangles in the list of a tile that has some"))
class FineRasterEvent(IntEnum):
    """Events of one tile, drawn by one warp. LANES are active lanes; all else counts warp executions or pixels."""

    SEGMENTS = 0  # reads of up to 32 list entries: header, early z and coverage each
    ENTRY_LANES = 1
    EARLY_Z_LANES = 2  # entries tested against the tile's largest depth
    EARLY_Z_KILLS = 3
    COVERAGE_LANES = 4  # masks computed
    EMPTY_MASKS = 5
    ZMAX_UPDATES = 6  # maxima over the tile's 64 depths
    FRAGMENT_ROUNDS = 7
    FRAGMENT_LANES = 8  # fragments distributed
    Z_KILLS = 9
    MSAA_KILLS = 10  # fragments without a covered sample
    SHADE_ROUNDS = 11  # fragment rounds with a survivor
    SHADE_LANES = 12
    ROP_STEPS = 13  # rounds of conflict resolution, by the pixel with most of them
    ROP_LANES = 14  # writes that took effect
    BLEND_LANES = 15  # survivors, once for each sample that any of them wrote: the D of "blend attempt rounds"
    BLEND_ROUND_LANES = 16  # the same times the rounds: its N
    SAMPLE_TESTS = 17  # points tested: 64 for each mask, and the samples of each fragment
    SAMPLE_HITS = 18
    SHARED_ATOMIC = 19
    BANK_REPLAYS = 20  # passes that lanes of one shared atomic at one pixel add
    TILE_LOADS = 21
    TILE_STORES = 22
    ATOMIC = 23  # draws from the tile counter
    ATOMIC_LANES = 24
    ATOMIC_REQUESTS = 25
    ATOMIC_DEPTH = 26
    LOAD_TRANSACTIONS = 27
    LOAD_BYTES = 28
    STORE_TRANSACTIONS = 29
    STORE_BYTES = 30
    WARP_STARTS = 31  # warps that start, at their first tile: coverage table, and the last draw, which finds no tile
    REFILLS = 32  # times that a warp reads on for more fragments
    FULL_SEGMENTS = 33  # reads that queue a triangle
    FULL_LANES = 34  # triangles queued
    PARTIAL_SEGMENTS = 35  # reads of fewer than 32 entries: the other lanes take a slow reciprocal along
    LIST_WARPS = 36  # SEGMENTS, for what only the lanes with an entry do
    TAG_WARPS = 37  # FRAGMENT_ROUNDS, for what only the lanes with a queued triangle do
    TAG_LANES = 38  # queued triangles, up to 32, summed over fragment rounds


class Draw(NamedTuple):
    """One draw as the kernels take it."""

    log_samples: int
    later_wins: bool  # nvdiffrast: of equal depths the later triangle shows
    depth: bool
    blend: bool
    write_color: bool
    interpolate: bool
    shade_late: bool  # each pixel once, when the tile is done: no later fragment sees its colour
    clear: bool  # deferred clear: tiles start from the clear values
    clear_color: int
    clear_depth: int
    half_width: int  # 1/16 pixel
    half_height: int
    tiles_x: int
    coalescing: int
    peel: bool = False  # a fragment lives only behind the depth of the layer before, which is in ``Tile.zmax``


class Tile(NamedTuple):
    """Scratch of one warp; pixel p of the tile is bit p of a coverage mask, its sample i at p + 64 * i."""

    depth: np.ndarray  # (samples * 64,) uint32
    color: np.ndarray  # (samples * 64,) uint32, RGBA from the low byte up
    owner: np.ndarray  # (samples * 64,) int32: record of the last write, -1 where there was none
    zmax: np.ndarray  # (64,) uint32: farthest sample of a pixel, several samples only; or the layer before
    before: np.ndarray  # (64,) uint32: depths before a round
    chain: np.ndarray  # (64,) int64: how often a round has hit a pixel
    more: np.ndarray  # (32,) uint64: pixels that a round has hit more than i times
    slots: np.ndarray  # (96,) int64: queue of triangles ...
    records: np.ndarray  # (96,) int64: ... their data records ...
    masks: np.ndarray  # (96,) uint64: ... and the fragments that they have left
    state: np.ndarray  # (7,) int64, see below
    pixel: np.ndarray  # (32,) int64: fragments of a round
    slot: np.ndarray  # (32,) int64
    mask: np.ndarray  # (32,) int64: covered samples
    addresses: np.ndarray  # (32,) int64


HEAD, TAIL, FRAGMENTS, NEXT, END, ZMAX, UPDATE = range(7)  # columns of Tile.state


@kernel
def new_tile(samples: int) -> Any:
    """Scratch for one warp."""
    many, i64, u32, u64 = samples * PIXELS, np.int64, np.uint32, np.uint64
    return Tile(
        np.empty(many, u32), np.empty(many, u32), np.empty(many, np.int32), np.empty(PIXELS, u32),
        np.empty(PIXELS, u32), np.zeros(PIXELS, i64), np.empty(WARP, u64), np.empty(QUEUE + SEGMENT, i64),
        np.empty(QUEUE + SEGMENT, i64), np.empty(QUEUE + SEGMENT, u64), np.zeros(7, i64),
        np.empty(WARP, i64), np.empty(WARP, i64), np.empty(WARP, i64), np.empty(WARP, i64),
    )  # fmt: skip


@kernel(lent=True)
def corner(tile_index: int, draw: Draw) -> Any:
    """Lower left corner of a tile in the units of headers."""
    left = (tile_index % draw.tiles_x) * (16 * TILE) - draw.half_width
    bottom = (tile_index // draw.tiles_x) * (16 * TILE) - draw.half_height
    return left, bottom


@kernel(lent=True)
def update_zmax(depths: Any, state: Any, row: Any) -> None:
    """Take the tile's largest depth anew, if a fragment has covered a pixel that had it."""
    if state[UPDATE]:
        largest = depths[0]
        for p in range(1, PIXELS):
            largest = max(largest, depths[p])
        state[ZMAX] = largest
        state[UPDATE] = 0
        if row is not None:
            row[FineRasterEvent.ZMAX_UPDATES] += 1


@kernel(lent=True)
def count_gather(tile: Tile, n: int, size: int, draw: Draw, row: Any) -> None:
    """Count a load of ``size`` bytes by each of n lanes at ``tile.addresses``."""
    count, read = transactions(tile.addresses, n, size, draw.coalescing)
    row[FineRasterEvent.LOAD_TRANSACTIONS] += count
    row[FineRasterEvent.LOAD_BYTES] += read


@kernel(lent=True)
def read_segment(setup: Setup, entries: Any, draw: Draw, tile: Tile, left: int, bottom: int, row: Any) -> None:
    """Read up to 32 entries, cull them by depth, and queue those with a non-empty mask."""
    state = tile.state
    first, last = state[NEXT], min(state[NEXT] + SEGMENT, state[END])
    state[NEXT] = last
    limit = state[ZMAX] + draw.later_wins
    killed = fragments = 0
    queued = tail = state[TAIL]
    for k in range(first, last):
        slot, ahead = np.int64(entries[k]), np.int64(entries[min(k + _AHEAD, entries.size - 1)])
        prefetch(setup.misc, ahead)
        prefetch(setup.headers, ahead)
        prefetch(setup.records, ahead)
        if row is not None:
            tile.addresses[k - first] = slot * HEADER_BYTES
        if draw.depth and np.int64(setup.misc[slot]) & 0xFFFFF000 >= limit:
            killed += 1
            continue
        header = setup.headers[slot]
        mask = square_mask(header, left, bottom) if draw.log_samples > 0 else pixel_mask(header, left, bottom)
        tile.slots[tail], tile.masks[tail], record = slot, mask, np.int64(setup.records[slot])
        tile.records[tail] = record
        prefetch(setup.planes, record)
        prefetch(setup.inputs, record)
        tail += mask != np.uint64(0)
        fragments += popcount(mask)
    state[TAIL] = tail
    state[FRAGMENTS] += fragments
    if row is not None:
        n = last - first
        row[FineRasterEvent.SEGMENTS] += 1
        row[FineRasterEvent.ENTRY_LANES] += n
        row[FineRasterEvent.EARLY_Z_LANES] += n if draw.depth else 0
        row[FineRasterEvent.EARLY_Z_KILLS] += killed
        row[FineRasterEvent.COVERAGE_LANES] += n - killed
        row[FineRasterEvent.EMPTY_MASKS] += n - killed - (tail - queued)
        row[FineRasterEvent.SAMPLE_TESTS] += PIXELS * (n - killed)
        row[FineRasterEvent.FULL_SEGMENTS] += tail > queued
        row[FineRasterEvent.FULL_LANES] += tail - queued
        row[FineRasterEvent.PARTIAL_SEGMENTS] += n < SEGMENT
        row[FineRasterEvent.LIST_WARPS] += 1
        loads, size = contiguous(0, n * ENTRY_BYTES, draw.coalescing)  # the entries, in a line of their own
        row[FineRasterEvent.LOAD_TRANSACTIONS] += loads + 2  # and the segment's count and the next segment
        row[FineRasterEvent.LOAD_BYTES] += size + 2 * smallest_transaction_bytes(draw.coalescing)
        count_gather(tile, n, HEADER_BYTES, draw, row)


@kernel(lent=True)
def refill(setup: Setup, entries: Any, draw: Draw, tile: Tile, left: int, bottom: int, row: Any) -> None:
    """Read on until 32 fragments are queued or the list ends."""
    state = tile.state
    queued = state[TAIL] - state[HEAD]
    for i in range(queued):
        tile.slots[i] = tile.slots[state[HEAD] + i]
        tile.masks[i] = tile.masks[state[HEAD] + i]
        tile.records[i] = tile.records[state[HEAD] + i]
    state[HEAD], state[TAIL] = 0, queued
    if row is not None:
        row[FineRasterEvent.REFILLS] += 1
    while state[FRAGMENTS] < WARP and state[NEXT] < state[END]:
        read_segment(setup, entries, draw, tile, left, bottom, row)


@kernel(lent=True)
def start_tile(tile: Tile, begin: int, end: int) -> None:
    """Empty the queue for a tile whose list is entries begin..end-1."""
    tile.state[:] = 0
    tile.state[NEXT] = begin
    tile.state[END] = end
    tile.state[ZMAX] = DEPTH_MAX
