"""Conflicts of one atomic instruction in a warp: lanes that want the same counter, or the same 32-byte lock.

The numbers are those of ``models.atomics`` (and tested against it); short lists of the distinct counters and chunks
make them cheap, because neighbours in the patch queue want the same few tiles.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt

WORD_BYTES = 4  # a counter
CHUNK_WORDS = CHUNK_BYTES // WORD_BYTES
HALF_WARP = 16  # lanes that CC 1.x sends together
_SECTOR = int(AtomicMerge.SECTOR)


class AtomicRule(NamedTuple):
    """How a machine takes the atomics of one warp: integers only."""

    warp: int
    group: int  # lanes that arrive together: a half-warp on 1.x
    merge: int  # an AtomicMerge
    padding: int  # words from one counter to the next


class Wanted(NamedTuple):
    """Scratch: the distinct counters that the lanes of one instruction want, and the distinct 32-byte chunks."""

    tile: NDArray[np.int64]
    tile_lanes: NDArray[np.int64]
    tile_chunk: NDArray[np.int64]  # index into the next three
    chunk: NDArray[np.int64]
    chunk_lanes: NDArray[np.int64]
    chunk_depth: NDArray[np.int64]  # lanes at the most wanted counter of the chunk
    together: NDArray[np.int64]  # (2, lanes) lanes of one group at a counter, and at a chunk


def atomic_rule(simt: Simt, padding: int) -> AtomicRule:
    """Rule of a machine for counters that lie ``padding`` words apart."""
    half = simt.coalescing == Coalescing.HALF_WARP_SEGMENTS
    return AtomicRule(simt.warp, min(HALF_WARP, simt.warp) if half else simt.warp, int(simt.atomic_merge), padding)


@kernel
def scratch(lanes: int) -> Any:
    """Make the lists for one warp."""
    return Wanted(
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
        np.empty((2, lanes), np.int64),
    )


@kernel(lent=True)
def keep_leaders(tile: Any, lanes: int, leaders: Any) -> None:
    """Copy only the first lane of each tile: it adds for the others (warp aggregation)."""
    for lane in range(lanes):
        leaders[lane] = tile[lane]
        for other in range(lane):
            if tile[other] == tile[lane]:
                leaders[lane] = -1
                break


@kernel(lent=True)
def _find(values: Any, found: int, value: int, guess: int) -> int:
    """Index of ``value``, or ``found``; a good guess saves the search."""
    if guess < found and values[guess] == value:
        return guess
    k = 0
    while k < found and values[k] != value:
        k += 1
    return k


@kernel(lent=True)
def list_wanted(tile: Any, lanes: int, group: int, padding: int, wanted: Wanted) -> tuple[int, int, int, int, int]:
    """List what the lanes of a warp want, of which ``group`` arrive together.

    Returns
    -------
    tiles, chunks, depth, group_depth, lock_depth : int
        Distinct counters and chunks; lanes at the most wanted counter; the same, and lanes in the most wanted chunk,
        of each group, summed.
    """
    of_tile, of_chunk = wanted.together
    tiles = chunks = depth = group_depth = lock_depth = most = chunk_most = k = begins = 0
    for lane in range(lanes):
        if lane == begins:  # a group
            begins += group
            of_tile[:tiles] = 0
            of_chunk[:chunks] = 0
            group_depth, lock_depth, most, chunk_most = group_depth + most, lock_depth + chunk_most, 0, 0
        if tile[lane] < 0:
            continue
        k = _find(wanted.tile, tiles, tile[lane], k)
        if k == tiles:
            chunk = tile[lane] * padding // CHUNK_WORDS
            c = _find(wanted.chunk, chunks, chunk, 0)
            if c == chunks:
                wanted.chunk[c] = chunk
                wanted.chunk_lanes[c] = 0
                wanted.chunk_depth[c] = of_chunk[c] = 0
                chunks += 1
            wanted.tile[k] = tile[lane]
            wanted.tile_lanes[k] = of_tile[k] = 0
            wanted.tile_chunk[k] = c
            tiles += 1
        wanted.tile_lanes[k] += 1
        c = wanted.tile_chunk[k]
        wanted.chunk_lanes[c] += 1
        of_tile[k] += 1
        of_chunk[c] += 1
        wanted.chunk_depth[c] = max(wanted.chunk_depth[c], wanted.tile_lanes[k])
        depth = max(depth, wanted.tile_lanes[k])
        most, chunk_most = max(most, of_tile[k]), max(chunk_most, of_chunk[c])
    return tiles, chunks, depth, group_depth + most, lock_depth + chunk_most


@kernel(lent=True)
def send_requests(wanted: Wanted, chunks: int, merge: int, table: Any) -> int:
    """Count the requests that leave the SM, every lane or what a merged chunk needs; add them to ``table`` by chunk."""
    total = 0
    for c in range(chunks):
        sent = wanted.chunk_depth[c] if merge == _SECTOR else wanted.chunk_lanes[c]
        table[wanted.chunk[c]] += sent
        total += sent
    return total
