"""Duplicate: one thread a Gaussian writes a pair of key and index for each tile that lists it.

A key is the tile above the bits of the depth, which is positive: in the order of keys, tiles lie one behind another
and each from near to far. A thread writes its pairs one behind another, so that lanes of a warp write to many places.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.events import DuplicateEvent
from tilestamp.simulator.stages.kerbl2023.gaussian import NEAR
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.sectors import record_sectors
from tilestamp.simulator.stages.kerbl2023.tile_rules import BOUNDS, SQUARE, cut_off, tile_columns, tile_rows
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
VALUE_BYTES = 4
NEAR_BITS = int(NEAR.view(np.int32))  # of the least depth
WHOLE_DEPTH = 32  # bits
UNROLLED = 4  # tiles of the loop over columns
_MOST = 2**31  # pairs: offsets are 32 bits wide
_PART = 1 << 13  # Gaussians, at least
_E = DuplicateEvent


class Keys(NamedTuple):
    """What a key is made of: the tile, and below it the depth."""

    bytes: int
    depth_bits: int  # of a key of 4 bytes the highest of the distance of a float's bits from those of the least depth
    sorted_bits: int


def keys_of(tiles: int, size: int = 8) -> Keys:
    """Give keys of 8 bytes, with all 32 bits of a depth, or of 4, with as many as the number of tiles leaves."""
    tile_bits = tiles.bit_length()
    if size == WHOLE_DEPTH // 4:
        return Keys(size, WHOLE_DEPTH, WHOLE_DEPTH + tile_bits)
    if tile_bits >= 8 * size:
        raise TilestampError(f"keys: {tiles:,} tiles leave no bit of {8 * size} for the depth")
    return Keys(size, 8 * size - tile_bits, 8 * size)


class Pairs(NamedTuple):
    """Pairs of tile and Gaussian.

    Parameters
    ----------
    keys : ndarray, (P,), uint64 or uint32
        See ``Keys``.
    values : ndarray, (P,), uint32
        Gaussians.
    """

    keys: NDArray[np.unsignedinteger]
    values: NDArray[np.uint32]


@kernel(lent=True)
def _write(
    i: int, at: int, out: Projected, rule: int, tiles: Tiles, shape: Keys, keys: Any, values: Any, widths: Any
) -> int:
    """Write the pairs of one Gaussian; gives its rows, and ``widths`` the tiles of each."""
    conic = out.conics[i]
    x, y, radius = out.positions[i, 0], out.positions[i, 1], out.radii[i]
    reach = cut_off(conic) if rule != SQUARE else (np.float32(0), np.float32(0), np.float32(0))
    first_row, last_row = tile_rows(rule, x, y, radius, reach, tiles)
    depth = np.int64(out.depths.view(np.int32)[i])
    if shape.depth_bits < WHOLE_DEPTH:
        depth = (depth - NEAR_BITS) >> (WHOLE_DEPTH - 1 - shape.depth_bits)
    for row in range(first_row, last_row + 1):
        first, last = tile_columns(rule, row, x, y, radius, reach, conic, tiles)
        widths[row - first_row] = max(0, last - first + 1)
        for column in range(first, last + 1):
            keys[at] = np.uint64((row * tiles.columns + column) << shape.depth_bits | depth)
            values[at] = i
            at += 1
    rows: int = max(0, last_row - first_row + 1)
    return rows


@kernel(lent=True)
def _count_row(
    first: int, lanes: int, r: int, tight: bool, begins: Any, widths: Any, size: int, segment: int, row: Any
) -> None:
    """Sectors of one row of tiles: a key and an index stored for each tile, and a depth loaded by the published rule.

    The loop over columns is compiled in fours, behind one for what is left over: lanes of other widths take turns.
    """
    fours = rest = 0
    for lane in range(lanes):
        fours = max(fours, widths[lane, r] // UNROLLED)
        rest = max(rest, widths[lane, r] % UNROLLED)
    loads = stores = 0
    for step in range(rest + UNROLLED * fours):
        key, value, depth = -1, -1, -1
        for lane in range(lanes):
            width = widths[lane, r]
            if step < width % UNROLLED if step < rest else (step - rest) // UNROLLED < width // UNROLLED:
                at = begins[lane]
                begins[lane] = at + 1
                stores += (at * size // segment != key) + (at * VALUE_BYTES // segment != value)
                key, value = at * size // segment, at * VALUE_BYTES // segment
                loads += (first + lane) * 4 // segment != depth
                depth = (first + lane) * 4 // segment
    row[_E.STEPS] += rest + UNROLLED * fours
    row[_E.STORE_TRANSACTIONS] += stores
    if not tight:
        row[_E.LOAD_TRANSACTIONS] += loads


@kernel(lent=True)
def _count_warp(
    first: int, lanes: int, begins: Any, sizes: Any, rows: Any, widths: Any, radii: Any, tight: bool, active: Any,
    size: int, segment: int, row: Any,
) -> None:  # fmt: skip
    """Events of one warp: of each lane where its pairs begin, how many they are, its rows of tiles, their widths."""
    visible, trips, row_trips = 0, 0, 0
    for lane in range(lanes):
        active[lane] = 1
    row[_E.LOAD_TRANSACTIONS] += record_sectors(active, lanes, first, 4, 1, 4, segment)
    for lane in range(lanes):
        active[lane] = radii[first + lane] > 0
        visible += active[lane]
        trips = max(trips, sizes[lane])
        row[_E.PAIRS] += sizes[lane]
        row_trips = max(row_trips, rows[lane])
        row[_E.ROW_LANES] += rows[lane]
    row[_E.WARPS] += 1
    row[_E.GAUSSIANS] += lanes
    row[_E.VISIBLE_WARPS] += visible > 0
    row[_E.VISIBLE_LANES] += visible
    row[_E.ROW_TRIPS] += row_trips
    row[_E.TRIPS] += trips
    row[_E.LONGEST_TRIPS] = max(row[_E.LONGEST_TRIPS], trips)
    row[_E.LONGEST_ROW_TRIPS] = max(row[_E.LONGEST_ROW_TRIPS], row_trips)
    if first == 0:
        active[0] = 0  # which adds up from nothing
    row[_E.LOAD_TRANSACTIONS] += record_sectors(active, lanes, first - 1, 4, 1, 4, segment)  # where the one before ends
    if first == 0:
        active[0] = radii[0] > 0
    row[_E.LOAD_TRANSACTIONS] += record_sectors(active, lanes, first, 8, 1, 8, segment)
    if tight:  # conic and depth
        row[_E.LOAD_TRANSACTIONS] += record_sectors(active, lanes, first, 16, 1, 16, segment)
        row[_E.LOAD_TRANSACTIONS] += record_sectors(active, lanes, first, 4, 1, 4, segment)
    for r in range(row_trips):
        for lane in range(lanes):
            widths[lane, r] = widths[lane, r] if r < rows[lane] else 0
        _count_row(first, lanes, r, tight, begins, widths, size, segment, row)


@kernel
def _duplicate(
    part: int, parts: int, out: Projected, ends: Any, bound: int, tiles: Tiles, shape: Keys, warp: int, segment: int,
    keys: Any, values: Any, table: Any,
) -> None:  # fmt: skip
    count = len(ends)
    blocks = (count + BLOCK - 1) // BLOCK
    rows, active = np.zeros(warp, np.int64), np.zeros(warp, np.int64)
    begins, sizes = np.zeros(warp, np.int64), np.zeros(warp, np.int64)
    widths = np.zeros((warp, tiles.rows), np.int64)
    for block in range(blocks * part // parts, blocks * (part + 1) // parts):
        end = min((block + 1) * BLOCK, count)
        for first in range(block * BLOCK, end, warp):
            lanes = min(warp, end - first)
            for lane in range(lanes):
                i = first + lane
                begins[lane] = ends[i - 1] if i else 0
                sizes[lane] = ends[i] - begins[lane]
                rows[lane] = 0
                if out.radii[i] > 0:
                    rows[lane] = _write(i, begins[lane], out, bound, tiles, shape, keys, values, widths[lane])
            if table is not None:
                tight, size, row = bound != SQUARE, shape.bytes, table[block]
                _count_warp(first, lanes, begins, sizes, rows, widths, out.radii, tight, active, size, segment, row)
        if table is not None:
            row = table[block]
            row[_E.BLOCKS] = 1
            row[_E.LOAD_BYTES] = row[_E.LOAD_TRANSACTIONS] * segment
            row[_E.STORE_BYTES] = row[_E.STORE_TRANSACTIONS] * segment


def duplicate(
    projected: Projected,
    ends: NDArray[np.int64],
    tiles: Tiles,
    simt: Simt,
    *,
    bound: str = "square",
    keys: Keys | None = None,
    counting: bool = True,
) -> StageResult[Pairs]:
    """Write the pairs of all Gaussians.

    Parameters
    ----------
    projected : Projected
    ends : ndarray, (N,), int64
        Inclusive sums of ``projected.tiles``.
    tiles : Tiles
    simt : Simt
    bound : {"square", "box", "ellipse"}
        By which rule ``projected.tiles`` were counted.
    keys : Keys, optional
        Of 8 bytes if not given.
    counting : bool

    Returns
    -------
    outputs : Pairs
        In the order of Gaussians, of each row by row.
    works : one, a row a block

    Raises
    ------
    TilestampError
        More pairs than 32-bit offsets count.
    """
    pairs = int(ends[-1])
    if pairs >= _MOST:
        raise TilestampError(f"{pairs:,} pairs of Gaussian and tile are more than 32-bit offsets count: larger tiles")
    made = keys or keys_of(tiles.total)
    found = Pairs(np.empty(pairs, f"u{made.bytes}"), np.empty(pairs, np.uint32))
    blocks = -(-len(ends) // BLOCK)
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    shape = (simt.warp, smallest_transaction_bytes(int(simt.coalescing)))
    parts = parts_of(blocks, _PART // BLOCK)
    for_parts(_duplicate, parts, projected, ends, BOUNDS[bound], tiles, made, *shape, *found, table)
    return StageResult(found, () if table is None else (duplicate_work(table, bound, made.bytes),))


def duplicate_work(table: NDArray[np.int64], bound: str, size: int) -> Work:
    """Work of the kernel, from the rows of its blocks."""
    total = table.sum(axis=0)
    lanes, visible, pairs = (int(total[event]) for event in (_E.GAUSSIANS, _E.VISIBLE_LANES, _E.PAIRS))
    stored = int(total[_E.STORE_TRANSACTIONS])
    by_size = size / (size + VALUE_BYTES)
    streams = [
        Stream("radii", "load", 4 * lanes, 4 * lanes),
        Stream("offsets", "load", 4 * visible, 4 * visible),
        Stream("positions", "load", 8 * visible, 8 * visible),
        Stream("depths", "load", 4 * pairs, 4 * visible),
        Stream(
            "keys", "store", round(int(total[_E.STORE_BYTES]) * by_size), size * pairs,
            partial_lines=round(stored * by_size),
        ),
        Stream(
            "values", "store", round(int(total[_E.STORE_BYTES]) * (1 - by_size)), VALUE_BYTES * pairs,
            partial_lines=round(stored * (1 - by_size)),
        ),
    ]  # fmt: skip
    if bound != "square":
        streams.append(Stream("conics", "load", 16 * visible, 16 * visible))
    kernel = "duplicate" if bound == "square" else "tight_duplicate"
    variant = "" if bound == "square" else bound
    return Work("duplicate", _E, table, BLOCK, kernel=kernel, streams=tuple(streams), variant=variant)
