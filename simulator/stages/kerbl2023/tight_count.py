"""Tight count: a pass behind the projection that counts the tiles of each Gaussian anew, by box or ellipse."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.events import TightCountEvent
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.sectors import record_sectors
from tilestamp.simulator.stages.kerbl2023.tile_rules import BOUNDS, cut_off, tile_columns, tile_rows
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
_PART = 1 << 14  # Gaussians, at least
_E = TightCountEvent


@kernel(lent=True)
def _count(i: int, out: Projected, bound: int, tiles: Tiles, counts: Any) -> Any:
    """Count the tiles of one; gives whether it has an extent, and its rows."""
    conic = out.conics[i]
    x, y, radius = out.positions[i, 0], out.positions[i, 1], out.radii[i]
    reach = cut_off(conic)
    first_row, last_row = tile_rows(bound, x, y, radius, reach, tiles)
    total = 0
    for row in range(first_row, last_row + 1):
        first, last = tile_columns(bound, row, x, y, radius, reach, conic, tiles)
        total += max(0, last - first + 1)
    counts[i] = total
    return reach[0] > 0, max(0, last_row - first_row + 1)


@kernel
def _tight_count(
    part: int, parts: int, out: Projected, bound: int, tiles: Tiles, warp: int, segment: int, counts: Any, table: Any
) -> None:
    count = len(counts)
    active = np.zeros(warp, np.int64)
    blocks = (count + BLOCK - 1) // BLOCK
    for i in range(blocks * part // parts * BLOCK, min(blocks * (part + 1) // parts * BLOCK, count), warp):
        lanes = min(warp, count - i)
        visible, opaque, rows, longest, pairs = 0, 0, 0, 0, 0
        for lane in range(warp):
            active[lane] = 0
            if lane < lanes and out.radii[i + lane] > 0:
                active[lane] = 1
                visible += 1
                extent, lane_rows = _count(i + lane, out, bound, tiles, counts)
                opaque += extent
                rows += lane_rows
                longest = max(longest, lane_rows)
                pairs += counts[i + lane]
        if table is not None:
            row = table[i // BLOCK]
            row[_E.WARPS] += 1
            row[_E.LANES] += lanes
            row[_E.VISIBLE_WARPS] += visible > 0
            row[_E.VISIBLE_LANES] += visible
            row[_E.OPAQUE_WARPS] += opaque > 0
            row[_E.OPAQUE_LANES] += opaque
            row[_E.ROW_TRIPS] += longest
            row[_E.ROW_LANES] += rows
            row[_E.LONGEST_ROW_TRIPS] = max(row[_E.LONGEST_ROW_TRIPS], longest)
            row[_E.PAIRS] += pairs
            row[_E.BLOCKS] = 1
            _count_sectors(i, lanes, warp, visible, active, segment, row)


@kernel(lent=True)
def _count_sectors(first: int, lanes: int, warp: int, visible: int, active: Any, segment: int, row: Any) -> None:
    """Radii of all, positions and conics of the visible; a count is stored for all."""
    loads = 0
    if visible:
        for size in (8, 16):
            loads += record_sectors(active, warp, first, size, 1, size, segment)
    for lane in range(warp):
        active[lane] = lane < lanes
    all_lanes = record_sectors(active, warp, first, 4, 1, 4, segment)
    row[_E.LOAD_TRANSACTIONS] += loads + all_lanes
    row[_E.LOAD_BYTES] += (loads + all_lanes) * segment
    row[_E.STORE_TRANSACTIONS] += all_lanes
    row[_E.STORE_BYTES] += all_lanes * segment


def tight_count(
    projected: Projected, tiles: Tiles, simt: Simt, *, bound: str, counting: bool = True
) -> StageResult[Projected]:
    """Give what was projected with the tiles that box or ellipse leave.

    Parameters
    ----------
    projected : Projected
    tiles : Tiles
    simt : Simt
    bound : {"box", "ellipse"}
    counting : bool

    Returns
    -------
    outputs : Projected
    works : one, a row a block
    """
    counts = np.zeros(len(projected.radii), np.uint32)
    blocks = -(-len(counts) // BLOCK)
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    shape = (simt.warp, smallest_transaction_bytes(int(simt.coalescing)))
    parts = parts_of(blocks, _PART // BLOCK)
    for_parts(_tight_count, parts, projected, BOUNDS[bound], tiles, *shape, counts, table)
    found = projected._replace(tiles=counts)
    return StageResult(found, () if table is None else (tight_count_work(table, bound),))


def tight_count_work(table: NDArray[np.int64], bound: str) -> Work:
    """Work of the kernel, from the rows of its blocks."""
    lanes, visible = (int(table[:, event].sum()) for event in (_E.LANES, _E.VISIBLE_LANES))
    streams = (
        Stream("radii", "load", 4 * lanes, 4 * lanes),
        Stream("positions", "load", 8 * visible, 8 * visible),
        Stream("conics", "load", 16 * visible, 16 * visible),
        Stream("tiles", "store", 4 * lanes, 4 * lanes, partial_lines=0),
    )
    return Work("project", _E, table, BLOCK, kernel="tight_count", variant=bound, streams=streams)
