"""Sort: pairs by their keys, a radix sort by digits of 8 bits, lowest first (Adinets & Merrill 2022, as in CUB).

One kernel counts the digits of all passes, one sums them up; then each pass reads the pairs once, in blocks of 5,760,
and writes each to its place: the pairs of a block that have a digit in common lie one behind another, a run. Pairs of
equal keys keep their order. Only the bits that keys can have are sorted: 32 of the depth and those of the tile count.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.duplicate import VALUE_BYTES, Pairs
from tilestamp.simulator.stages.kerbl2023.events import SortEvent
from tilestamp.simulator.work import Work

DIGIT_BITS = 8
RADIX = 1 << DIGIT_BITS
BLOCK = 384  # threads of a pass
ITEMS = 15  # pairs a thread
SHARED_BYTES = 47104
HISTOGRAM_BLOCK, HISTOGRAM_SHARED_BYTES, HISTOGRAM_BLOCKS_PER_SM = 128, 8192, 9
TILE = BLOCK * ITEMS  # pairs a block
HISTOGRAM_TILE = 16 * HISTOGRAM_BLOCK  # keys that a block of the histogram reads at a time
COUNTS_A_SECTOR = SECTOR_BYTES // 4
BIN_SECTORS = RADIX * 4 // SECTOR_BYTES  # of a count of each digit
BINS_STORED = 2  # by a block: its own counts, then those of all blocks up to it
BINS_READ = 14  # by a block: where digits begin, and counts of blocks before it; as an H200 does in the mean
_E = SortEvent


@kernel
def _histogram(part: int, parts: int, keys: Any, shift: int, counts: Any) -> None:
    """Digits of each block of a part of the blocks."""
    blocks = len(counts)
    for block in range(blocks * part // parts, blocks * (part + 1) // parts):
        row = counts[block]
        for i in range(block * TILE, min((block + 1) * TILE, len(keys))):
            row[(keys[i] >> np.uint64(shift)) & np.uint64(RADIX - 1)] += 1


@kernel
def _starts(counts: Any, starts: Any) -> None:
    """Where the run of each block and digit begins."""
    at = 0
    total = np.zeros(RADIX, np.int64)
    for block in range(len(counts)):
        for digit in range(RADIX):
            total[digit] += counts[block, digit]
    for digit in range(RADIX):
        count = total[digit]
        total[digit] = at
        at += count
    for block in range(len(counts)):
        for digit in range(RADIX):
            starts[block, digit] = total[digit]
            total[digit] += counts[block, digit]


@kernel
def _scatter(
    part: int, parts: int, keys: Any, values: Any, shift: int, starts: Any, new_keys: Any, new_values: Any
) -> None:
    """Write the pairs of a part of the blocks to their places."""
    blocks = len(starts)
    for block in range(blocks * part // parts, blocks * (part + 1) // parts):
        row = starts[block]
        for i in range(block * TILE, min((block + 1) * TILE, len(keys))):
            key = keys[i]
            digit = (key >> np.uint64(shift)) & np.uint64(RADIX - 1)
            at = row[digit]
            row[digit] = at + 1
            new_keys[at] = key
            new_values[at] = values[i]


@kernel(lent=True)
def _run_sectors(place: int, start: int, count: int, size: int, warp: int) -> int:
    """Sectors of a run that begins at a place of the sorted block: each instruction stores a warp's pairs of it."""
    sectors = 0
    while count:
        part = min(count, warp - place % warp)
        for width in (size, VALUE_BYTES):
            sectors += ((start + part) * width - 1) // SECTOR_BYTES - start * width // SECTOR_BYTES + 1
        place, start, count = place + part, start + part, count - part
    return sectors


@kernel
def _count_runs(counts: Any, starts: Any, pairs: int, key_bytes: int, warp: int, table: Any) -> None:
    """Events of the blocks of a pass: loads of whole blocks, stores of runs, and the digit counts of blocks before."""
    for block in range(len(counts)):
        row = table[block]
        size = min(TILE, pairs - block * TILE)
        row[_E.WARPS] = (BLOCK + warp - 1) // warp
        row[_E.PAIRS] = size
        row[_E.BLOCKS] = row[_E.PASSES] = 1
        row[_E.LOAD_TRANSACTIONS] = BINS_READ * BIN_SECTORS
        row[_E.STORE_TRANSACTIONS] = BINS_STORED * BIN_SECTORS
        for width in (key_bytes, VALUE_BYTES):
            row[_E.LOAD_TRANSACTIONS] += (size * width + SECTOR_BYTES - 1) // SECTOR_BYTES
        place = 0
        for digit in range(RADIX):
            count = counts[block, digit]
            if count:
                row[_E.DIGITS] += 1
                row[_E.STORE_TRANSACTIONS] += _run_sectors(place, starts[block, digit], count, key_bytes, warp)
                place += count
        row[_E.ALIKE], row[_E.MIXED] = row[_E.DIGITS] == 1, row[_E.DIGITS] > 1
        row[_E.LOAD_BYTES] = row[_E.LOAD_TRANSACTIONS] * SECTOR_BYTES
        row[_E.STORE_BYTES] = row[_E.STORE_TRANSACTIONS] * SECTOR_BYTES


def sort(pairs: Pairs, bits: int, simt: Simt, *, counting: bool = True) -> StageResult[Pairs]:
    """Sort pairs.

    Parameters
    ----------
    pairs : Pairs
        Overwritten.
    bits : int
        Of the keys, the lowest so many are sorted.
    simt : Simt
    counting : bool

    Returns
    -------
    outputs : Pairs
    works : the histogram, the exclusive sum, and one for each pass
    """
    count = len(pairs.keys)
    blocks = -(-count // TILE)
    passes = -(-bits // DIGIT_BITS)
    other = Pairs(np.empty_like(pairs.keys), np.empty_like(pairs.values))
    works, used = [], np.zeros((passes, RADIX), np.bool_)
    counts, starts = np.empty((2, blocks, RADIX), np.int64)
    parts = parts_of(blocks)
    for k in range(passes):
        shift = k * DIGIT_BITS
        counts[:] = 0
        for_parts(_histogram, parts, pairs.keys, shift, counts)
        _starts(counts, starts)
        used[k] = counts.any(axis=0)
        if counting and count:
            works.append(_pass_work(k, counts, starts, pairs, simt))
        for_parts(_scatter, parts, *pairs, shift, starts, *other)
        pairs, other = other, pairs
    if works:
        works = [_histogram_work(count, pairs.keys.itemsize, used, simt), _sum_work(passes, simt), *works]
    return StageResult(pairs, tuple(works))


def _streams(count: int, key_bytes: int, stored: int, *, back: bool) -> tuple[Stream, ...]:
    """What a pass reads and writes: keys and values, from one pair of buffers to the other; ``stored``: by sectors."""
    names = ("", "2") if not back else ("2", "")
    sizes = (("keys", key_bytes), ("values", VALUE_BYTES))
    loads = [Stream(name + names[0], "load", size * count, size * count) for name, size in sizes]
    pair = key_bytes + VALUE_BYTES
    return (*loads, *(Stream(name + names[1], "store", stored * size // pair, size * count) for name, size in sizes))


def _pass_work(k: int, counts: NDArray[np.int64], starts: NDArray[np.int64], pairs: Pairs, simt: Simt) -> Work:
    table = np.zeros((len(counts), len(_E)), np.int64)
    count, key_bytes = len(pairs.keys), pairs.keys.itemsize
    _count_runs(counts, starts, count, key_bytes, simt.warp, table)
    table[0, _E.DIGITS_USED] = np.count_nonzero(counts.any(axis=0))
    streams = _streams(count, key_bytes, int(table[:, _E.STORE_BYTES].sum()), back=k % 2 == 1)
    return pass_work(table, streams, f"pass {k}")


def pass_work(table: NDArray[np.int64], streams: tuple[Stream, ...] = (), variant: str = "") -> Work:
    """Work of one pass, from the rows of its blocks."""
    return Work(
        "sort", _E, table, BLOCK, kernel="sort_onesweep", shared_bytes=SHARED_BYTES, streams=streams, variant=variant
    )


def _histogram_work(pairs: int, key_bytes: int, used: NDArray[np.bool_], simt: Simt) -> Work:
    """Persistent blocks, a fixed number an SM, that each count the digits of some tiles of keys, and add up at the end.

    ``used`` are the digits that occur, (passes, RADIX). A block is taken to have all of them: it adds each sector of
    counts that is not empty, and all blocks want the same few.
    """
    blocks, tiles = HISTOGRAM_BLOCKS_PER_SM * simt.sms, -(-pairs // HISTOGRAM_TILE)
    table = np.zeros((blocks, len(_E)), np.int64)
    table[:, _E.WARPS] = -(-HISTOGRAM_BLOCK // simt.warp)
    table[:, _E.PAIRS] = (tiles // blocks + (np.arange(blocks) < tiles % blocks)) * HISTOGRAM_TILE
    table[(tiles - 1) % blocks, _E.PAIRS] -= tiles * HISTOGRAM_TILE - pairs
    table[:, _E.BLOCKS], table[:, _E.PASSES], table[:, _E.LISTED] = 1, len(used), table[:, _E.PAIRS] > 0
    table[:, _E.LOAD_TRANSACTIONS] = -(-table[:, _E.PAIRS] * key_bytes // SECTOR_BYTES)
    table[:, _E.LOAD_BYTES] = table[:, _E.LOAD_TRANSACTIONS] * SECTOR_BYTES
    sectors = used.reshape(len(used), -1, COUNTS_A_SECTOR).any(axis=2)
    warps = used.reshape(len(used), -1, simt.warp).any(axis=2)
    adds = {_E.ATOMIC: warps.sum(), _E.ATOMIC_LANES: used.sum(), _E.ATOMIC_REQUESTS: sectors.sum()}
    for event, count in adds.items():
        table[:, event] = count * table[:, _E.LISTED]
    return Work(
        "sort",
        _E,
        table,
        HISTOGRAM_BLOCK,
        kernel="sort_histogram",
        grid=blocks,
        shared_bytes=HISTOGRAM_SHARED_BYTES,
        streams=(Stream("keys", "load", key_bytes * pairs, key_bytes * pairs),),
        atomic_requests=sectors.ravel() * table[:, _E.LISTED].sum(),
        grid_by_sms=True,
    )


def _sum_work(passes: int, simt: Simt) -> Work:
    """A block a pass, a thread a digit."""
    table = np.zeros((passes, len(_E)), np.int64)
    table[:, _E.WARPS], table[:, _E.BLOCKS], table[:, _E.PASSES] = -(-RADIX // simt.warp), 1, 1
    moved = RADIX * 4
    table[:, [_E.LOAD_TRANSACTIONS, _E.STORE_TRANSACTIONS]] = moved // SECTOR_BYTES
    table[:, [_E.LOAD_BYTES, _E.STORE_BYTES]] = moved
    return Work(
        "sort",
        _E,
        table,
        RADIX,
        kernel="sort_exclusive_sum",
        grid=passes,
        streams=(Stream("digits", "load", passes * moved, passes * moved),),
    )
