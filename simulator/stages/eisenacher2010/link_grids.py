"""Find the neighbours of grids, so that a vertex of several is shaded once (not in Eisenacher & Loop 2010).

A sub-patch looks for those of its size to the left of it, above it, and above on the left, in the same urPatch: across
urPatches, and where sizes differ, vertices are shaded by each. The table is a hash table of the sub-patches' numbers
with linear probing: one kernel fills it by compare-and-swap, one looks up; who finds a neighbour leaves its own number
there. We let the threads fill the table one after the other; that two lanes of a warp want one slot at the same time,
which is rare in a table half empty, is not counted.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES, contiguous, transactions
from tilestamp.models.counters import count, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.work import Work

BLOCK = 256  # threads, a sub-patch each
WORD_BYTES, ENTRY_BYTES, LINKS_BYTES = 4, 8, 16
NEIGHBOURS = ((1, 0), (0, 1), (1, 1))  # steps back along u and v: left, above, above on the left
_SCATTER = 0x9E3779B97F4A7C15  # 2**64 over the golden ratio


@shown(count("PROBES", "slots of the table of sub-patches looked at"))
class LinkEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # load a queue entry
    WARP_LANES = 1
    PROBE_WARPS = 2  # a slot of the table a lane: compare-and-swap, or load and compare with the entry it names
    PROBES = 3
    ATOMIC_LANES = 4
    ATOMIC_REQUESTS = 5
    ATOMIC_DEPTH = 6
    LINK_WARPS = 7  # that leave a number with a neighbour in at least one lane
    LINKS = 8  # neighbours found
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12


_E = LinkEvent


class Links(NamedTuple):
    """Numbers of the neighbours of each sub-patch, -1 where there is none: left, above, above on the left."""

    before: NDArray[np.int32]  # (N, 3)
    after: NDArray[np.int32]  # (N, 3) who has this one as its neighbour: on the right, below, below on the right


def keys_of(subpatches: SubPatches) -> NDArray[np.uint64]:
    """A queue entry and its urPatch in one word."""
    patch, level, i, j = (array.astype(np.uint64) for array in subpatches[:4])
    packed: NDArray[np.uint64] = patch << np.uint64(32) | level << np.uint64(28) | i << np.uint64(14) | j
    return packed


@kernel(lent=True)
def _slot(key: Any, bits: int) -> Any:
    return np.int64((key * np.uint64(_SCATTER)) >> np.uint64(64 - bits))


@kernel
def _fill(keys: Any, bits: int, slots: Any, warp: int, coalescing: int, table: Any) -> None:
    """Put every sub-patch in the hash table."""
    mask = slots.size - 1
    for first in range(0, keys.size, warp):
        lanes = min(warp, keys.size - first)
        row, most = table[first // BLOCK], 0
        for n in range(first, first + lanes):
            at, probes = _slot(keys[n], bits), 1
            while slots[at] >= 0:
                at, probes = (at + 1) & mask, probes + 1
            slots[at] = n
            most = max(most, probes)
            row[_E.PROBES] += probes
        row[_E.PROBE_WARPS] += most
        row[_E.ATOMIC_DEPTH] += most
        _count_warp(first, lanes, coalescing, row)
    table[:, _E.ATOMIC_LANES] = table[:, _E.PROBES]
    table[:, _E.ATOMIC_REQUESTS] = table[:, _E.PROBES]


@kernel(lent=True)
def _count_warp(first: int, lanes: int, coalescing: int, row: Any) -> None:
    """Load the entries of a warp, and store a vector of links a lane."""
    row[_E.WARPS] += 1
    row[_E.WARP_LANES] += lanes
    loads, load_bytes = contiguous(first * ENTRY_BYTES, lanes * ENTRY_BYTES, coalescing)
    stores, store_bytes = contiguous(first * LINKS_BYTES, lanes * LINKS_BYTES, coalescing)
    row[_E.LOAD_TRANSACTIONS] += loads
    row[_E.LOAD_BYTES] += load_bytes
    row[_E.STORE_TRANSACTIONS] += stores
    row[_E.STORE_BYTES] += store_bytes


@kernel
def _find(
    keys: Any, i: Any, j: Any, steps: Any, bits: int, slots: Any, warp: int, coalescing: int, before: Any, after: Any,
    table: Any,
) -> None:  # fmt: skip
    """Look for the neighbours of every sub-patch, a warp in step; ``at`` is the slot that a lane looks at next."""
    mask = slots.size - 1
    at, slot_words, entries = np.empty(warp, np.int64), np.empty(warp, np.int64), np.empty(warp, np.int64)
    for first in range(0, keys.size, warp):
        lanes = min(warp, keys.size - first)
        row = table[first // BLOCK]
        _count_warp(first, lanes, coalescing, row)
        for step in range(steps.shape[0]):
            back = np.uint64(steps[step, 0] << 14 | steps[step, 1])
            for lane in range(lanes):
                n = first + lane
                has = i[n] >= steps[step, 0] and j[n] >= steps[step, 1]
                at[lane] = _slot(keys[n] - back, bits) if has else -1
            active = lanes
            while active > 0:
                active = found = 0
                for lane in range(lanes):
                    slot_words[lane] = at[lane] * WORD_BYTES if at[lane] >= 0 else -1
                    entries[lane] = -1
                    if at[lane] < 0:
                        continue
                    active += 1
                    other = slots[at[lane]]
                    entries[lane] = other * ENTRY_BYTES if other >= 0 else -1
                    if other >= 0 and keys[other] == keys[first + lane] - back:
                        before[first + lane, step], after[other, step] = other, first + lane
                        found += 1
                        at[lane] = -1
                    else:
                        at[lane] = (at[lane] + 1) & mask if other >= 0 else -1
                row[_E.LINK_WARPS] += found > 0
                row[_E.LINKS] += found
                if active > 0:
                    row[_E.PROBE_WARPS] += 1
                    row[_E.PROBES] += active
                    for addresses, size in ((slot_words, WORD_BYTES), (entries, ENTRY_BYTES)):
                        loads, load_bytes = transactions(addresses, lanes, size, coalescing)
                        row[_E.LOAD_TRANSACTIONS] += loads
                        row[_E.LOAD_BYTES] += load_bytes


def link_grids(subpatches: SubPatches, simt: Simt) -> StageResult[Links]:
    """Find the neighbours of each sub-patch.

    Parameters
    ----------
    subpatches : SubPatches
    simt : Simt

    Returns
    -------
    outputs : Links
    works : filling the table, and looking up in it; a row a block
    """
    keys, number = keys_of(subpatches), len(subpatches.patch)
    bits = max(1, 2 * number - 1).bit_length()
    slots = np.full(1 << bits, -1, np.int32)
    filled, found = np.zeros((2, -(-number // BLOCK), len(_E)), np.int64)
    links = Links(np.full((number, 3), -1, np.int32), np.full((number, 3), -1, np.int32))
    machine = simt.warp, int(simt.coalescing)
    _fill(keys, bits, slots, *machine, filled)
    _find(keys, subpatches.i, subpatches.j, np.array(NEIGHBOURS), bits, slots, *machine, *links, found)
    found[:, _E.STORE_TRANSACTIONS] += found[:, _E.LINKS]  # a word in the neighbour's vector
    found[:, _E.STORE_BYTES] += SECTOR_BYTES * found[:, _E.LINKS]
    works = _work("fill_table", filled, slots.size), _work("find_neighbours", found, slots.size)
    return StageResult(links, works)


def _work(name: str, table: NDArray[np.int64], slots: int) -> Work:
    """Work of one kernel; the table is set to its empty state by a copy that is not counted."""
    number, total = int(table[:, _E.WARP_LANES].sum()), table.sum(axis=0)
    entries, links = number * ENTRY_BYTES, number * LINKS_BYTES
    streams = [Stream("queue", "load", entries, entries)]
    if name == "fill_table":
        probed = int(total[_E.ATOMIC_REQUESTS]) * SECTOR_BYTES
        streams += [
            Stream("slots of sub-patches", "atomic", probed, slots * WORD_BYTES),
            Stream("links after", "store", links, links, partial_lines=0),
        ]
    else:
        looked = int(total[_E.LOAD_BYTES]) - entries
        streams += [
            Stream("slots of sub-patches", "load", looked, slots * WORD_BYTES + entries),
            Stream("links before", "store", links, links, partial_lines=0),
            Stream("links after", "store", int(total[_E.STORE_BYTES]) - links, links),
        ]
    return Work("link_grids", _E, table, BLOCK, kernel=name, streams=tuple(streams))
