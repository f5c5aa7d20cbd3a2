"""Global atomics: what leaves the SM, and how lanes of one instruction stand in each other's way.

requests    messages that the memory system serves, by the machine's merging rule (``AtomicMerge``). NONE: each lane
            travels by itself (GT200). SECTOR: lanes at distinct words of one 32-byte sector share a request, lanes
            at the same address do not, so a sector takes as many requests as its busiest word has lanes
            (measured on an H200: 8 words of a sector, 4 lanes each, run 8 times as fast as 32 lanes on one word).
conflicts   lanes at an address that an earlier lane of the instruction has.
depth       the largest number of lanes at one address: 1 without conflict, 0 when no lane is active.

An instruction is an int64 array of byte addresses, negative where a lane is inactive. Who queues where across warps
is counted by the caller, by ``address // CHUNK_BYTES``: the table ``Work.atomic_requests``.
"""

from typing import Any

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import AtomicMerge

SECTOR = int(AtomicMerge.SECTOR)
SECTOR_BYTES = 32
CHUNK_BYTES = 32  # granularity of Launch.atomic_requests


@kernel(lent=True)
def count_atomics(addresses: Any, lanes: int, merge: int) -> tuple[int, int, int, int]:
    """Active lanes, requests, conflicts and depth of one atomic instruction.

    Parameters
    ----------
    addresses : ndarray, (>= lanes,), int64
        Byte address of each lane; negative where it is inactive.
    lanes : int
        Lanes to look at, at most 64.
    merge : int
        An ``AtomicMerge``.

    Returns
    -------
    active, requests, conflicts, depth : int
    """
    active = 0
    conflicts = 0
    depth = 0
    for i in range(lanes):
        if addresses[i] < 0:
            continue
        active += 1
        rank = 1
        for j in range(i):
            if addresses[j] == addresses[i]:
                rank += 1
        if rank > 1:
            conflicts += 1
        depth = max(depth, rank)
    merged = _sector_requests(addresses, lanes) if merge == SECTOR else active
    return active, merged, conflicts, depth


@kernel(lent=True)
def requests(addresses: Any, lanes: int, merge: int) -> int:
    """Count the requests of one atomic instruction after merging."""
    count: int = count_atomics(addresses, lanes, merge)[1]
    return count


@kernel(lent=True)
def conflicts(addresses: Any, lanes: int) -> int:
    """Count the lanes at an address that an earlier lane has."""
    count: int = count_atomics(addresses, lanes, 0)[2]
    return count


@kernel(lent=True)
def depth(addresses: Any, lanes: int) -> int:
    """Count the lanes at the most wanted address."""
    crowd: int = count_atomics(addresses, lanes, 0)[3]
    return crowd


@kernel(lent=True)
def add_requests(addresses: Any, lanes: int, merge: int, base: int, chunks: Any) -> None:
    """Add the requests of one instruction to a table by 32-byte chunk: who queues where.

    Parameters
    ----------
    addresses, lanes, merge
        As for ``count_atomics``.
    base : int
        Byte address at which the target buffer, and so chunk 0, begins.
    chunks : ndarray, (chunks,), int64
        Requests so far; added to.
    """
    served = 0  # bit i: lane i
    for i in range(lanes):
        if addresses[i] < 0 or (served >> i) & 1:
            continue
        busiest = 1
        if merge == SECTOR:
            served, busiest = _sector(addresses, i, lanes, served)
        chunks[(addresses[i] - base) >> 5] += busiest


@kernel(lent=True)
def _sector_requests(addresses: Any, lanes: int) -> int:
    """Sum, over the sectors touched, the lanes at their most wanted address."""
    total = 0
    served = 0
    for i in range(lanes):
        if addresses[i] >= 0 and not (served >> i) & 1:
            served, busiest = _sector(addresses, i, lanes, served)
            total += busiest
    return total


@kernel(lent=True)
def _sector(addresses: Any, first: int, lanes: int, served: int) -> tuple[int, int]:
    """Mark the lanes in the sector of lane ``first`` as served; count those at its most wanted address."""
    most = 1
    for i in range(first, lanes):
        if 0 <= (addresses[i] ^ addresses[first]) < SECTOR_BYTES:
            served |= 1 << i
            same = 1
            for j in range(i + 1, lanes):
                if addresses[j] == addresses[i]:
                    same += 1
            most = max(most, same)
    return served, most
