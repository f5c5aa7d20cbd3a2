"""Ranges: one thread a pair finds where the list of a tile begins and ends in the sorted pairs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES, smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.events import RangesEvent
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
PAIR_BYTES = 8  # of a range: start and end
_E = RangesEvent


@kernel
def _ranges(keys: Any, depth_bits: int, starts: Any, warp: int, segment: int, table: Any) -> None:
    """Fill ``starts``; a thread whose pair is of another tile than the one before stores both ends."""
    tile = np.int64(0)
    before, last_warp, end_sector, start_sector = np.int64(-1), -1, np.int64(-1), np.int64(-1)
    for i in range(len(keys)):
        here = np.int64(keys[i] >> np.uint64(depth_bits))
        while tile <= here:
            starts[tile] = i
            tile += 1
        if table is not None and here != before:
            row = table[i // BLOCK]
            row[_E.LISTED_TILES] += 1
            if i // warp != last_warp:
                last_warp, end_sector, start_sector = i // warp, np.int64(-1), np.int64(-1)
                row[_E.EDGE_WARPS] += 1
            if i:  # the end of the list before
                row[_E.STORE_TRANSACTIONS] += (before * PAIR_BYTES + 4) // segment != end_sector
                end_sector = (before * PAIR_BYTES + 4) // segment
            row[_E.STORE_TRANSACTIONS] += here * PAIR_BYTES // segment != start_sector
            start_sector = here * PAIR_BYTES // segment
        before = here
    starts[tile:] = len(keys)
    if table is not None:
        table[-1, _E.STORE_TRANSACTIONS] += 1  # the end of the last list


def ranges(
    keys: NDArray[np.unsignedinteger], tiles: int, simt: Simt, *, depth_bits: int = 32, counting: bool = True
) -> StageResult[NDArray[np.int64]]:
    """Find where the list of each tile begins.

    Parameters
    ----------
    keys : ndarray, (P,), uint64 or uint32
        Sorted.
    tiles : int
    simt : Simt
    depth_bits : int
        Of a key, below the tile.
    counting : bool

    Returns
    -------
    outputs : ndarray, (tiles + 1,), int64
        Tile i has the pairs from ``outputs[i]`` on, and those before ``outputs[i + 1]``.
    works : one, a row a block; none where there are no pairs
    """
    starts = np.zeros(tiles + 1, np.int64)
    blocks = -(-len(keys) // BLOCK)
    table = np.zeros((blocks, len(_E)), np.int64) if counting and blocks else None
    segment = smallest_transaction_bytes(int(simt.coalescing))
    _ranges(keys, depth_bits, starts, simt.warp, segment, table)
    return StageResult(starts, () if table is None else (_work(table, keys, tiles, simt),))


def _work(table: NDArray[np.int64], keys: NDArray[np.unsignedinteger], tiles: int, simt: Simt) -> Work:
    pairs, size = len(keys), keys.itemsize
    lanes = np.full(len(table), BLOCK, np.int64)
    lanes[-1] = pairs - (len(table) - 1) * BLOCK
    table[:, _E.WARPS], table[:, _E.PAIRS], table[:, _E.BLOCKS] = -(-lanes // simt.warp), lanes, 1
    one = -(-lanes * size // SECTOR_BYTES)
    table[:, _E.LOAD_TRANSACTIONS] = 2 * one + table[:, _E.WARPS]  # the key, and that of the thread before
    table[:, _E.LOAD_BYTES] = table[:, _E.LOAD_TRANSACTIONS] * SECTOR_BYTES
    table[:, _E.STORE_BYTES] = table[:, _E.STORE_TRANSACTIONS] * SECTOR_BYTES
    streams = (
        Stream("keys", "load", 2 * size * pairs, size * pairs),
        Stream("ranges", "store", int(table[:, _E.STORE_BYTES].sum()), 8 * tiles),
    )
    return Work("ranges", _E, table, BLOCK, streams=streams)
