"""What one block of the tile raster costs, whatever its quads cover: grids, batches, memory, barriers.

A block reads its list of grids in batches, as many as it has threads for (16 vertices a grid), and walks through all
quads of a batch with all its warps.
"""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.banks import bank_passes
from tilestamp.models.coalescing import SEGMENT_BYTES, contiguous, transactions
from tilestamp.models.counters import distribution, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster_resolve import resolve_replays
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import GRID_SIDE, QUADS
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS

HALF_WARP = 16  # lanes that load the edges of a grid together
VECTOR_BYTES = 16  # a vertex; and the width of a load
VECTOR_WORDS = 4
WORD_BYTES = 4
EDGE_VECTORS, SHORT_VECTORS = 27, 14  # a grid: 12 floats a quad, where edge equations are loaded, or 16-bit terms
ALIGNMENTS = 8  # ways in which a number of vectors lie in 128-byte segments
SHORT = ("half", "fixed", "snapped")  # edge equations in 16 bits
SEGMENT_WORDS = SEGMENT_BYTES // WORD_BYTES  # places in a segment where the pixels of a tile may begin
BROADCAST_LOADS = 4  # vertices that each lane reads for a quad
EDGE_LOADS, SHORT_LOADS = 3, 2  # vectors that each lane reads for the edges of a quad
_HALF_WARP = int(Coalescing.HALF_WARP_SEGMENTS)


@shown(*SAMPLE_COUNTERS, distribution("grids", "GRIDS", "grids in the list of a tile"))
class TileRasterEvent(IntEnum):
    """Events of one block, which is one tile.

    ``X_WARPS`` counts the executions of a piece of code by a warp, ``X_LANES`` the lanes active meanwhile.
    """

    PIXEL_WARPS = 0  # start and end of the kernel
    PIXEL_LANES = 1
    GRIDS = 2  # grids in the tile's list; larger ones as so many of 9 quads
    BATCHES = 3  # times that the block fills its shared memory with grids
    BATCH_WARPS = 4
    GATHER_WARPS = 5  # warps that load an index and a vertex a lane, and leave the vertex in shared memory
    GATHER_LANES = 6
    EDGE_GATHER_WARPS = 7  # the same for vectors of edge equations, where they are loaded
    EDGE_GATHER_LANES = 8
    QUAD_WARPS = 9  # quads that a warp looks at: four vertices read, their box found
    QUAD_LANES = 10
    SUBTILE_TEST_WARPS = 11  # tests of a quad's box against a sub-tile, the same for all lanes
    SUBTILE_TEST_LANES = 12
    SUBTILE_PASS = 13  # pairs of quad and sub-tile that go on, counted once a block
    BOX_TEST_WARPS = 14  # tests of a quad's box against each lane's sample
    BOX_TEST_LANES = 15
    BOX_WARPS = 16  # edge functions evaluated: at least one lane's sample is in the box
    BOX_LANES = 17
    EDGE_SETUP_WARPS = 18  # of BOX_WARPS: with edge equations computed from the vertices
    HIT_WARPS = 19  # at least one sample covered: z interpolated
    HIT_LANES = 20
    Z_WARPS = 21  # at least one z-test passed: colour interpolated
    Z_LANES = 22
    SAMPLE_TESTS = 23  # point-in-quad evaluations, lanes along for the ride included
    SAMPLE_HITS = 24
    RESOLVE_WARPS = 25  # samples stored to shared memory and gathered again
    SHARED_ACCESSES = 26  # warp instructions, the loads and stores named above
    BANK_REPLAYS = 27
    BARRIERS = 28  # one for each warp that arrives
    LOAD_TRANSACTIONS = 29
    LOAD_BYTES = 30
    STORE_TRANSACTIONS = 31
    STORE_BYTES = 32
    LIST_WARPS = 33  # of PIXEL_WARPS: in a tile that has grids


_E = TileRasterEvent


def events_with(name: str, in_place: Mapping[TileRasterEvent, str], more: Sequence[str]) -> Any:
    """Events of a kernel that does more than the tile raster: some in place of events that it has not, and further."""
    names = [*(in_place.get(event, event.name) for event in TileRasterEvent), *more]
    made: Any = IntEnum
    return made(name, names, start=0, module=__name__)


class BlockShape(NamedTuple):
    """A block and its machine, as kernels take them: integers only."""

    tile: int  # pixels a side
    side: int  # sub-tiles a side: samples a pixel are side**2
    side_bits: int  # log2 of it
    subtile: float  # pixels a side of a sub-tile
    warp: int
    warp_bits: int  # log2 of the lanes: kernels shift, a division would be most of their work
    warps: int
    coalescing: int
    box_tests: bool
    loaded: int  # vectors of edge equations that are loaded for a grid
    grid: int = GRID_SIDE  # vertices a side


class BlockTraffic(NamedTuple):
    """Memory traffic that is alike in all blocks."""

    grid: NDArray[np.int64]  # transactions and bytes of one grid's vertices, by its alignment
    edges: NDArray[np.int64]  # transactions and bytes of one grid's edge equations, by its alignment
    gather_replays: int  # shared store of a full warp of vectors
    resolve_replays: int  # of a block


def block_shape(
    tile: int, spp: int, simt: Simt, *, box_tests: bool, loaded: bool, grid: int = GRID_SIDE, short: bool = False
) -> BlockShape:
    """Shape of a block of ``tile**2`` threads; ``grid`` vertices are a side of a grid; ``short`` edges have 16 bits."""
    side = {1: 1, 4: 2, 16: 4}[spp]
    bits = simt.warp.bit_length() - 1
    warps = -(-tile * tile // simt.warp)
    return BlockShape(
        tile, side, side.bit_length() - 1, tile / side, simt.warp, bits, warps, int(simt.coalescing), box_tests,
        loaded * (SHORT_VECTORS if short else EDGE_VECTORS),
        grid,
    )  # fmt: skip


def shape_for(
    vertices: NDArray[np.float32], tiles: Tiles, simt: Simt, *, spp: int, box_tests: bool, edges: str
) -> BlockShape:
    """Shape of the blocks that draw these grids."""
    side = math.isqrt(vertices.shape[1])
    return block_shape(
        tiles.size, spp, simt, box_tests=box_tests, loaded=edges != "computed", grid=side, short=edges in SHORT
    )


def block_traffic(shape: BlockShape, simt: Simt) -> BlockTraffic:
    """Count what is alike in all blocks."""
    edges = np.zeros((ALIGNMENTS, 2), np.int64)
    for place in range(ALIGNMENTS):
        base = place * shape.loaded * VECTOR_BYTES
        for first in range(0, shape.loaded, HALF_WARP):
            count = min(HALF_WARP, shape.loaded - first)
            address = (np.arange(count, dtype=np.int64) + first) * VECTOR_BYTES + base
            edges[place] += transactions(address, count, VECTOR_BYTES, shape.coalescing)
    full = min(shape.warp, shape.tile**2)
    shared = Simt(*map(int, simt))  # one type for the compiler
    gather = bank_passes(np.arange(full) * VECTOR_WORDS, full, shared, VECTOR_WORDS) - -(-full // simt.bank_lanes)
    resolved = resolve_replays(shape.tile, shape.side, shared) if shape.side > 1 else 0
    return BlockTraffic(_vectors(shape.grid**2, shape), edges, gather, resolved)


def _vectors(count: int, shape: BlockShape) -> NDArray[np.int64]:
    """Transactions and bytes of ``count`` vectors in a row that lanes load together, by the alignment of the first."""
    moved = np.zeros((ALIGNMENTS, 2), np.int64)
    for place in range(ALIGNMENTS):
        address = (np.arange(count, dtype=np.int64) + place * count) * VECTOR_BYTES
        for first in range(0, count, shape.warp):
            lanes = min(shape.warp, count - first)
            moved[place] += transactions(address[first:], lanes, VECTOR_BYTES, shape.coalescing)
    return moved


@kernel(lent=True)
def grids_together(shape: BlockShape) -> int:
    """Grids of one batch: a vertex a thread, but one whole grid at least."""
    return max(1, shape.tile * shape.tile // (shape.grid * shape.grid))


@kernel(lent=True)
def box_warps(span: Any, shape: BlockShape) -> Any:
    """Warps that have a lane in the columns and rows of ``span``, which lies in one sub-tile."""
    mask, bits = shape.tile - 1, shape.warp_bits  # tiles and warps are powers of two
    first_row, last_row = span[2] & mask, span[3] & mask
    if shape.warp >= shape.tile:  # a warp holds whole rows
        return (last_row * shape.tile >> bits) - (first_row * shape.tile >> bits) + 1
    return (last_row - first_row + 1) * (((span[1] & mask) >> bits) - ((span[0] & mask) >> bits) + 1)


@kernel(lent=True)
def count_block(
    block: Any, lists: Any, first: int, grids: int, shape: BlockShape, traffic: BlockTraffic, row: Any
) -> None:
    """Add the events that depend on the length of the list only, and the memory traffic of loads."""
    threads = shape.tile * shape.tile
    batch = grids_together(shape)
    quads = grids * (shape.grid - 1) * (shape.grid - 1)
    subtiles = shape.side * shape.side
    row[_E.PIXEL_WARPS] = row[_E.RESOLVE_WARPS] = shape.warps
    row[_E.PIXEL_LANES] = threads
    row[_E.LIST_WARPS] = shape.warps if grids > 0 else 0
    row[_E.GRIDS] = (quads + QUADS - 1) // QUADS
    row[_E.BATCHES] = (grids + batch - 1) // batch
    row[_E.BATCH_WARPS] = row[_E.BATCHES] * shape.warps
    row[_E.QUAD_WARPS] = quads * shape.warps
    row[_E.QUAD_LANES] = quads * threads
    if shape.box_tests:
        row[_E.SUBTILE_TEST_WARPS] = quads * subtiles * shape.warps
        row[_E.SUBTILE_TEST_LANES] = quads * subtiles * threads
        row[_E.BOX_TEST_WARPS] = row[_E.SUBTILE_PASS] * shape.warps
        row[_E.BOX_TEST_LANES] = row[_E.SUBTILE_PASS] * threads
    else:
        row[_E.SUBTILE_PASS] = quads * subtiles
        row[_E.BOX_WARPS] = quads * subtiles * shape.warps
        row[_E.BOX_LANES] = quads * subtiles * threads
    row[_E.EDGE_SETUP_WARPS] = 0 if shape.loaded > 0 else row[_E.BOX_WARPS]
    row[_E.SAMPLE_TESTS] = row[_E.BOX_WARPS] * min(shape.warp, threads)
    row[_E.SAMPLE_HITS] = row[_E.HIT_LANES]
    _count_loads(block, lists, first, grids, shape, traffic, row)
    row[_E.SHARED_ACCESSES] += row[_E.GATHER_WARPS] + BROADCAST_LOADS * row[_E.QUAD_WARPS]
    row[_E.BANK_REPLAYS] += row[_E.GATHER_WARPS] * traffic.gather_replays
    if shape.loaded > 0:
        reads = EDGE_LOADS if shape.loaded == EDGE_VECTORS else SHORT_LOADS
        row[_E.SHARED_ACCESSES] += row[_E.EDGE_GATHER_WARPS] + reads * row[_E.BOX_WARPS]
        row[_E.BANK_REPLAYS] += row[_E.EDGE_GATHER_WARPS] * traffic.gather_replays
    row[_E.BARRIERS] = 2 * row[_E.BATCH_WARPS]
    if subtiles == 1:
        row[_E.RESOLVE_WARPS] = 0
    else:
        row[_E.SHARED_ACCESSES] += 2 * subtiles * shape.warps
        row[_E.BANK_REPLAYS] += traffic.resolve_replays
        row[_E.BARRIERS] += 2 * shape.warps


@kernel(lent=True)
def _count_loads(
    block: Any, lists: Any, first: int, grids: int, shape: BlockShape, traffic: BlockTraffic, row: Any
) -> None:
    """COUNT by every warp, START if there are grids; then an index for 16 lanes, a grid and its edges by the same."""
    vertices = shape.grid * shape.grid
    together = 1 if shape.coalescing == _HALF_WARP else max(1, shape.warp // vertices)  # grids an instruction
    requests = shape.warps * (max(1, shape.warp // HALF_WARP) if shape.coalescing == _HALF_WARP else 1)
    count, size = contiguous(block * WORD_BYTES, WORD_BYTES, shape.coalescing)
    words = 2 if grids > 0 else 1
    row[_E.LOAD_TRANSACTIONS] += words * requests * count
    row[_E.LOAD_BYTES] += words * requests * size
    batch = grids_together(shape)
    for base in range(0, grids, batch):
        loaded = min(batch, grids - base)
        warps = (loaded * vertices + shape.warp - 1) // shape.warp
        row[_E.GATHER_WARPS] += warps
        row[_E.GATHER_LANES] += loaded * vertices
        for i in range(base, base + loaded, together):
            indices = min(together, base + loaded - i)
            count, size = contiguous((first + i) * WORD_BYTES, indices * WORD_BYTES, shape.coalescing)
            row[_E.LOAD_TRANSACTIONS] += count
            row[_E.LOAD_BYTES] += size
        if shape.loaded > 0:
            row[_E.EDGE_GATHER_WARPS] += (shape.loaded + HALF_WARP - 1) // HALF_WARP * warps
            row[_E.EDGE_GATHER_LANES] += loaded * shape.loaded
            for i in range(base, base + loaded):
                row[_E.LOAD_TRANSACTIONS] += traffic.edges[lists[first + i] % ALIGNMENTS, 0]
                row[_E.LOAD_BYTES] += traffic.edges[lists[first + i] % ALIGNMENTS, 1]
    for i in range(first, first + grids):
        row[_E.LOAD_TRANSACTIONS] += traffic.grid[lists[i] % ALIGNMENTS, 0]
        row[_E.LOAD_BYTES] += traffic.grid[lists[i] % ALIGNMENTS, 1]


@kernel(lent=True)
def count_stores(
    x0: int, y0: int, width: int, height: int, shape: BlockShape, addresses: Any, known: Any, row: Any
) -> None:
    """Colour of each pixel on the screen, and depth where there is one sample a pixel.

    Whole tiles that begin at the same word of a segment store alike: ``known``, (SEGMENT_WORDS, 2), zeros at first.
    """
    buffers, at = 2 if shape.side == 1 else 1, (y0 * width + x0) % SEGMENT_WORDS
    whole = x0 + shape.tile <= width and y0 + shape.tile <= height
    count, size = known[at, 0], known[at, 1]
    if not whole or count == 0:
        count, size = _stores(x0, y0, width, height, shape, addresses)
        if whole:
            known[at, 0], known[at, 1] = count, size
    row[_E.STORE_TRANSACTIONS] += buffers * count
    row[_E.STORE_BYTES] += buffers * size


@kernel(lent=True)
def _stores(x0: int, y0: int, width: int, height: int, shape: BlockShape, addresses: Any) -> tuple[int, int]:
    """Transactions, and their bytes, of a word of each pixel on the screen."""
    threads, transfers, total = shape.tile * shape.tile, 0, 0
    for first in range(0, threads, shape.warp):
        lanes = min(shape.warp, threads - first)
        for lane in range(lanes):
            y = y0 + (first + lane) // shape.tile
            x = x0 + (first + lane) % shape.tile
            addresses[lane] = (y * width + x) * WORD_BYTES if x < width and y < height else -1
        count, size = transactions(addresses, lanes, WORD_BYTES, shape.coalescing)
        transfers += count
        total += size
    return transfers, total
