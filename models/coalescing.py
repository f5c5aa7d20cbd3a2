"""Coalescing: how the addresses of one memory instruction become transactions.

A warp's load or store names one address a lane. The memory system moves whole segments, so what it costs is the
number of distinct segments, by a rule that changed with the compute capability (CUDA 4.2 guide, appendix F):

======================  ==============================================================================================
HALF_WARP_SEGMENTS      1.2 and 1.3. Each half-warp by itself: take the 128-byte segment of the lowest lane not yet
                        served (64 bytes for 2-byte words, 32 for bytes), serve all lanes in it, halve the segment
                        while one half alone is used, down to 32 bytes; repeat.
WARP_LINES              2.x and 3.x through L1. Distinct 128-byte lines of the warp; 8-byte words go as two requests
                        (half-warps), 16-byte words as four (quarter-warps).
WARP_SECTORS            5.x and later. Distinct 32-byte sectors of the warp (CUDA 11 guide, K.4.2).
======================  ==============================================================================================

Everywhere in this package an instruction is an int64 array with the byte address of each lane, **negative where the
lane is inactive**, and the number of lanes in use. All functions run inside stage kernels and allocate nothing.
"""

from typing import Any

import numpy as np

from tilestamp.models.bits import active_lanes, lanes_near, lowest_bit, popcount
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Coalescing

HALF_WARP_SEGMENTS = int(Coalescing.HALF_WARP_SEGMENTS)
WARP_LINES = int(Coalescing.WARP_LINES)
WARP_SECTORS = int(Coalescing.WARP_SECTORS)
HALF_WARP = 16  # lanes
SEGMENT_BYTES = 128  # largest transaction of 1.x, and a line of all later ones
SECTOR_BYTES = 32  # smallest transaction of every rule
WORD_BYTES = 4
WARP_BYTES = 128  # consecutive words of 32 lanes


@kernel(lent=True)
def smallest_transaction_bytes(rule: int) -> int:
    """Bytes of the smallest transaction of a ``Coalescing`` rule: what a word that lies by itself costs."""
    return SEGMENT_BYTES if rule == WARP_LINES else SECTOR_BYTES


@kernel(lent=True)
def transactions(addresses: Any, lanes: int, access_bytes: int, rule: int) -> tuple[int, int]:
    """Transactions of one memory instruction, and their bytes.

    Parameters
    ----------
    addresses : ndarray, (>= lanes,), int64
        Byte address of each lane, aligned to ``access_bytes``; negative where the lane is inactive.
    lanes : int
        Lanes to look at, at most 64.
    access_bytes : int
        Bytes that each lane reads or writes: 1, 2, 4, 8 or 16.
    rule : int
        A ``Coalescing``.

    Returns
    -------
    count, bytes : int
    """
    request, segment = lanes, smallest_transaction_bytes(rule)
    shrink = rule == HALF_WARP_SEGMENTS
    if shrink:
        request, segment = HALF_WARP, min(SEGMENT_BYTES, SECTOR_BYTES * access_bytes)
    elif rule == WARP_LINES and access_bytes > WORD_BYTES:
        request = _lanes_of_a_line(access_bytes)
    rising = 0 if shrink else _rising_segments(addresses, lanes, request, segment)
    if rising == 0 and not shrink and request >= lanes:
        rising = _paired_segments(addresses, lanes, segment)
    if rising > 0:
        return rising, rising * segment
    count = 0
    total = 0
    for first in range(0, lanes, max(1, request)):
        n, b = _segments(addresses, first, min(first + request, lanes), access_bytes, segment, shrink)
        count += n
        total += b
    return count, total


@kernel(lent=True)
def transactions_of_runs(addresses: Any, starts: Any, lanes: int, access_bytes: int, rule: int) -> tuple[int, int]:
    """``transactions`` where runs of lanes access one address each.

    Parameters
    ----------
    addresses : ndarray, (>= lanes,), int64
        Of the first lane of each run, none inactive; the others' are written where they are needed.
    starts : uint64
        Bit i: a run starts at lane i; bit 0 is set.
    lanes, access_bytes, rule : int
        As of ``transactions``.
    """
    segment = smallest_transaction_bytes(rule)
    first, last, falls, rest = np.uint64(0), np.int64(-1), rule == HALF_WARP_SEGMENTS, starts
    while rest != np.uint64(0):
        here = addresses[lowest_bit(rest)] & -segment
        falls |= here < last
        first |= (rest & (~rest + np.uint64(1))) if here != last else np.uint64(0)
        rest &= rest - np.uint64(1)
        last = here
    if not falls:
        if rule == WARP_LINES and access_bytes > WORD_BYTES:
            for lane in range(0, lanes, _lanes_of_a_line(access_bytes)):
                first |= np.uint64(1) << np.uint64(lane)
        count = popcount(first)
        return count, count * segment
    for lane in range(1, lanes):
        if not (starts >> np.uint64(lane)) & np.uint64(1):
            addresses[lane] = addresses[lane - 1]
    found: tuple[int, int] = transactions(addresses, lanes, access_bytes, rule)
    return found


@kernel(lent=True)
def _lanes_of_a_line(access_bytes: int) -> int:
    """Lanes of one request where a word is wider than 4 bytes, and a line is all that a request can take."""
    return max(1, 2 * HALF_WARP * WORD_BYTES // access_bytes)


@kernel(lent=True)
def touched_lines(addresses: Any, lanes: int) -> int:
    """Distinct lines of 128 bytes of one memory instruction; parameters as of ``transactions``."""
    count: int = _segments(addresses, 0, lanes, WORD_BYTES, SEGMENT_BYTES, False)[0]
    return count


@kernel(lent=True)
def _segments(
    addresses: Any, first: int, end: int, access_bytes: int, segment_bytes: int, shrink: bool
) -> tuple[int, int]:
    """Distinct segments of the lanes first..end-1 and their bytes; ``shrink`` halves a segment that is half unused."""
    count = 0
    total = 0
    waiting = active_lanes(addresses, first, end)  # bit i: lane first + i
    while waiting != np.uint64(0):
        here = addresses[first + lowest_bit(waiting)]
        together = lanes_near(addresses, first, end, here, segment_bytes)
        waiting &= ~together
        count += 1
        total += _used(addresses, first, end, together, access_bytes, segment_bytes) if shrink else segment_bytes
    return count, total


@kernel(lent=True)
def _used(addresses: Any, first: int, end: int, together: Any, access_bytes: int, segment_bytes: int) -> int:
    """Bytes of the smallest part of a segment that holds what some lanes of it access, to the last byte of each."""
    size, here = SECTOR_BYTES, addresses[first + lowest_bit(together)]
    while size < segment_bytes:
        begin, room = here // size * size, size - access_bytes + 1  # an access that begins in this room ends in it
        if together & ~lanes_near(addresses, first, end, begin, room) == np.uint64(0):
            break
        size *= 2
    return size


@kernel(lent=True)
def _rising_segments(addresses: Any, lanes: int, request: int, segment_bytes: int) -> int:
    """Distinct segments of lanes whose addresses never fall, as most do; 0 where one falls or a lane is inactive.

    A segment counts again in each ``request`` of so many lanes, a power of two where there are several.
    """
    if lanes == 0 or addresses[0] < 0:
        return 0
    falls = False
    count = 1
    apart = request - 1 if request < lanes else -1
    for i in range(1, lanes):  # in several lanes at once
        falls |= addresses[i] < addresses[i - 1]
        count += ((addresses[i] ^ addresses[i - 1]) >= segment_bytes) | (i & apart == 0)
    return 0 if falls else count


@kernel(lent=True)
def _paired_segments(addresses: Any, lanes: int, segment_bytes: int) -> int:
    """Distinct segments where neither the even lanes' addresses fall nor the odd ones', and theirs lie apart; else 0.

    So lie the vertices of a strip of triangles, which takes them from two rows by turns.
    """
    if lanes < 2 or min(addresses[0], addresses[1]) < 0:
        return 0
    falls = False
    count = 2
    for i in range(2, lanes):  # in several lanes at once
        falls |= addresses[i] < addresses[i - 2]
        count += (addresses[i] ^ addresses[i - 2]) >= segment_bytes
    one, other = addresses[lanes - 1] & -segment_bytes, addresses[lanes - 2] & -segment_bytes  # the last of each
    first, second = addresses[(lanes - 1) & 1], addresses[lanes & 1]
    return count if not falls and (first > other + segment_bytes - 1 or second > one + segment_bytes - 1) else 0


@kernel(lent=True)
def _shrunk(low: int, high: int, segment_bytes: int) -> int:
    """Bytes of the smallest aligned segment, down to 32 bytes, that still holds low..high-1."""
    size = segment_bytes
    while size > SECTOR_BYTES and (low ^ (high - 1)) < size >> 1:
        size >>= 1
    return size


@kernel(lent=True)
def contiguous(start: int, size: int, rule: int) -> tuple[int, int]:
    """Transactions, and their bytes, when consecutive lanes access consecutive 4-byte words.

    Parameters
    ----------
    start, size : int
        First byte and number of bytes; beyond 128 bytes further warps go on.
    rule : int
        A ``Coalescing``.
    """
    warps = size // WARP_BYTES
    count, total = _one_warp(start, WARP_BYTES, rule) if warps else (0, 0)
    rest = size - warps * WARP_BYTES
    n, b = _one_warp(start + warps * WARP_BYTES, rest, rule) if rest else (0, 0)
    return warps * count + n, warps * total + b


@kernel(lent=True)
def _one_warp(start: int, size: int, rule: int) -> tuple[int, int]:
    """``contiguous`` for at most 128 bytes."""
    if rule != HALF_WARP_SEGMENTS:
        segment = smallest_transaction_bytes(rule)
        count = (start + size - 1) // segment - start // segment + 1
        return count, count * segment
    count = 0
    total = 0
    for half in range(start, start + size, HALF_WARP * WORD_BYTES):
        low = half
        end = min(half + HALF_WARP * WORD_BYTES, start + size)
        while low < end:
            high = min(end, (low // SEGMENT_BYTES + 1) * SEGMENT_BYTES)
            count += 1
            total += _shrunk(low, high, SEGMENT_BYTES)
            low = high
    return count, total
