"""Conflicts of one atomic instruction in a warp: lanes that want the same counter, or the same 32-byte lock.

The numbers are those of ``models.atomics`` (and tested against it); they are found a counter at a time, for all lanes
that want it at once: cheap, because neighbours in the patch queue want the same few tiles.
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.bits import active_lanes, lanes_near, lowest_bit, popcount
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


def atomic_rule(simt: Simt, padding: int) -> AtomicRule:
    """Rule of a machine for counters that lie ``padding`` words apart."""
    half = simt.coalescing == Coalescing.HALF_WARP_SEGMENTS
    return AtomicRule(simt.warp, min(HALF_WARP, simt.warp) if half else simt.warp, int(simt.atomic_merge), padding)


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
def count_wanted(
    tile: Any, lanes: int, rule: AtomicRule, word: Any, requests: Any
) -> tuple[int, int, int, int, int, int]:
    """Count what the lanes of a warp want, chunk by chunk and in each counter by counter.

    Parameters
    ----------
    tile : ndarray, (>= lanes,), int64
        Tile of each lane, negative where it is inactive.
    lanes : int
        At most 64.
    rule : AtomicRule
    word : ndarray, (>= lanes,), int64
        Scratch: where the counters lie.
    requests : ndarray, (chunks,), int64
        Requests that leave the SM, every lane or what a merged chunk needs; added to.

    Returns
    -------
    tiles, chunks, depth, group_depth, lock_depth, sent : int
        Distinct counters and chunks; lanes at the most wanted counter; the same, and lanes in the most wanted chunk,
        of each group that arrives together, summed; requests.
    """
    for lane in range(lanes):
        word[lane] = tile[lane] * rule.padding
    group = np.uint64(2**64 - 1) >> np.uint64(64 - rule.group)
    tiles = chunks = depth = most = others = chunk_most = chunk_others = sent = 0
    left = active_lanes(word, 0, lanes)
    while left != np.uint64(0):
        here = word[lowest_bit(left)]
        in_chunk = lanes_near(word, 0, lanes, here, CHUNK_WORDS)
        left &= ~in_chunk
        chunk_depth, rest = 0, in_chunk
        while rest != np.uint64(0):
            same = lanes_near(word, 0, lanes, word[lowest_bit(rest)], 1)
            rest &= ~same
            tiles += 1
            chunk_depth = max(chunk_depth, popcount(same))
            most, others = max(most, popcount(same & group)), max(others, popcount(same & ~group))
        chunks += 1
        depth = max(depth, chunk_depth)
        chunk_most = max(chunk_most, popcount(in_chunk & group))
        chunk_others = max(chunk_others, popcount(in_chunk & ~group))
        needed = chunk_depth if rule.merge == _SECTOR else popcount(in_chunk)
        requests[here // CHUNK_WORDS] += needed
        sent += needed
    return tiles, chunks, depth, most + others, chunk_most + chunk_others, sent


@kernel(lent=True)
def most_wanted(tile: Any, lanes: int) -> int:
    """Count the lanes at the most wanted of some counters; parameters as of ``count_wanted``."""
    most, left = 0, active_lanes(tile, 0, lanes)
    while left != np.uint64(0):
        same = lanes_near(tile, 0, lanes, tile[lowest_bit(left)], 1)
        left &= ~same
        most = max(most, popcount(same))
    return most
