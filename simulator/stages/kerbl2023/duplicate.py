"""Duplicate: one thread a Gaussian writes a pair of key and index for each tile that lists it.

A key is the tile above the bits of the depth, which is positive: in the order of keys, tiles lie one behind another
and each from near to far. A thread writes its pairs one behind another, so that lanes of a warp write to many places.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.events import DuplicateEvent
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.sectors import record_sectors, rising_transactions
from tilestamp.simulator.stages.kerbl2023.tile_rules import BOUNDS, SQUARE, cut_off, tile_columns, tile_rows
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
KEY_BYTES, VALUE_BYTES = 8, 4
_MOST = 2**31  # pairs: offsets are 32 bits wide
_PART = 1 << 13  # Gaussians, at least
_E = DuplicateEvent


class Pairs(NamedTuple):
    """Pairs of tile and Gaussian.

    Parameters
    ----------
    keys : ndarray, (P,), uint64
        Tile, and below it 32 bits of depth.
    values : ndarray, (P,), uint32
        Gaussians.
    """

    keys: NDArray[np.uint64]
    values: NDArray[np.uint32]


@kernel(lent=True)
def _write(i: int, at: int, out: Projected, rule: int, tiles: Tiles, keys: Any, values: Any) -> int:
    """Write the pairs of one Gaussian; gives its rows."""
    conic = out.conics[i]
    x, y, radius = out.positions[i, 0], out.positions[i, 1], out.radii[i]
    reach = cut_off(conic) if rule != SQUARE else (np.float32(0), np.float32(0), np.float32(0))
    first_row, last_row = tile_rows(rule, x, y, radius, reach, tiles)
    depth = np.uint64(out.depths.view(np.uint32)[i])
    for row in range(first_row, last_row + 1):
        first, last = tile_columns(rule, row, x, y, radius, reach, conic, tiles)
        for column in range(first, last + 1):
            keys[at] = (np.uint64(row * tiles.columns + column) << np.uint64(32)) | depth
            values[at] = i
            at += 1
    rows: int = max(0, last_row - first_row + 1)
    return rows


@kernel(lent=True)
def _count_trips(first: int, lanes: int, trips: int, ends: Any, scratch: Any, rule: int, row: Any) -> None:
    """Sectors of the loop over tiles: in each trip a depth is loaded, a key and an index stored."""
    for trip in range(trips):
        for lane in range(lanes):
            here = ends[first + lane - 1] + trip if first + lane else trip
            scratch[0, lane] = here * KEY_BYTES if here < ends[first + lane] else -1
            scratch[1, lane] = here * VALUE_BYTES if here < ends[first + lane] else -1
            scratch[2, lane] = (first + lane) * 4 if here < ends[first + lane] else -1
        for access in range(3):
            n, size = rising_transactions(scratch[access], lanes, 4 if access else KEY_BYTES, rule)
            if access == 2:
                row[_E.LOAD_TRANSACTIONS] += n
                row[_E.LOAD_BYTES] += size
            else:
                row[_E.STORE_TRANSACTIONS] += n
                row[_E.STORE_BYTES] += size


@kernel(lent=True)
def _count_warp(
    first: int, lanes: int, warp: int, ends: Any, rows: Any, radii: Any, tight: int, active: Any, scratch: Any,
    rule: int, row: Any,
) -> None:  # fmt: skip
    """Events of one warp."""
    visible, trips, row_trips = 0, 0, 0
    for lane in range(warp):
        active[lane] = 1
        if lane >= lanes:
            active[lane] = 0
    n, size = record_sectors(active, warp, first, 4, 1, 4, rule, scratch[0])
    row[_E.LOAD_TRANSACTIONS] += n
    row[_E.LOAD_BYTES] += size
    for lane in range(lanes):
        active[lane] = radii[first + lane] > 0
        visible += active[lane]
        before = ends[first + lane - 1] if first + lane else 0
        trips = max(trips, ends[first + lane] - before)
        row[_E.PAIRS] += ends[first + lane] - before
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
    if visible:
        for k in range(3 if tight else 2):
            size = 4 << k
            n, total = record_sectors(active, warp, first, size, 1, size, rule, scratch[0])
            row[_E.LOAD_TRANSACTIONS] += n
            row[_E.LOAD_BYTES] += total
    _count_trips(first, lanes, trips, ends, scratch, rule, row)


@kernel
def _duplicate(
    part: int, parts: int, out: Projected, ends: Any, bound: int, tiles: Tiles, warp: int, rule: int, keys: Any,
    values: Any, table: Any,
) -> None:  # fmt: skip
    """Write the pairs of a part of the blocks."""
    count = len(ends)
    blocks = (count + BLOCK - 1) // BLOCK
    rows, active = np.zeros(warp, np.int64), np.zeros(warp, np.int64)
    scratch = np.zeros((3, warp), np.int64)
    for block in range(blocks * part // parts, blocks * (part + 1) // parts):
        end = min((block + 1) * BLOCK, count)
        for first in range(block * BLOCK, end, warp):
            lanes = min(warp, end - first)
            for lane in range(lanes):
                i = first + lane
                rows[lane] = 0
                if out.radii[i] > 0:
                    rows[lane] = _write(i, ends[i - 1] if i else 0, out, bound, tiles, keys, values)
            if table is not None:
                tight = int(bound != SQUARE)
                _count_warp(first, lanes, warp, ends, rows, out.radii, tight, active, scratch, rule, table[block])
        if table is not None:
            table[block, _E.BLOCKS] = 1


def duplicate(
    projected: Projected,
    ends: NDArray[np.int64],
    tiles: Tiles,
    simt: Simt,
    *,
    bound: str = "square",
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
    keys, values = np.empty(pairs, np.uint64), np.empty(pairs, np.uint32)
    blocks = -(-len(ends) // BLOCK)
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    shape = (simt.warp, int(simt.coalescing))
    parts = parts_of(blocks, _PART // BLOCK)
    for_parts(_duplicate, parts, projected, ends, BOUNDS[bound], tiles, *shape, keys, values, table)
    return StageResult(Pairs(keys, values), () if table is None else (duplicate_work(table, bound),))


def duplicate_work(table: NDArray[np.int64], bound: str) -> Work:
    """Work of the kernel, from the rows of its blocks."""
    total = table.sum(axis=0)
    lanes, visible, pairs = (int(total[event]) for event in (_E.GAUSSIANS, _E.VISIBLE_LANES, _E.PAIRS))
    stored = int(total[_E.STORE_TRANSACTIONS])
    by_size = KEY_BYTES / (KEY_BYTES + VALUE_BYTES)
    streams = [
        Stream("radii", "load", 4 * lanes, 4 * lanes),
        Stream("offsets", "load", 4 * visible, 4 * visible),
        Stream("positions", "load", 8 * visible, 8 * visible),
        Stream("depths", "load", 4 * pairs, 4 * visible),
        Stream(
            "keys", "store", round(int(total[_E.STORE_BYTES]) * by_size), KEY_BYTES * pairs,
            partial_lines=round(stored * by_size),
        ),
        Stream(
            "values", "store", round(int(total[_E.STORE_BYTES]) * (1 - by_size)), VALUE_BYTES * pairs,
            partial_lines=round(stored * (1 - by_size)),
        ),
    ]  # fmt: skip
    if bound != "square":
        streams.append(Stream("conics", "load", 16 * visible, 16 * visible))
    return Work(
        stage="duplicate",
        kernel="duplicate" if bound == "square" else "tight_duplicate",
        events=_E,
        table=table,
        grid=len(table),
        block=BLOCK,
        streams=tuple(streams),
        variant="" if bound == "square" else bound,
    )
