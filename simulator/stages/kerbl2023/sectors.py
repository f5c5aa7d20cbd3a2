"""Transactions of a warp whose active lanes touch rising addresses, as records by the lane's number do."""

from typing import Any

from tilestamp.models.coalescing import HALF_WARP, HALF_WARP_SEGMENTS, SECTOR_BYTES, SEGMENT_BYTES, transactions
from tilestamp.models.coalescing import WARP_LINES as LINES
from tilestamp.models.kernel import kernel

WORD_BYTES = 4


@kernel(lent=True)
def rising_transactions(addresses: Any, lanes: int, access_bytes: int, rule: int) -> tuple[int, int]:
    """``transactions`` of lanes whose addresses never fall, inactive ones (negative) left out."""
    if rule == HALF_WARP_SEGMENTS:
        found: tuple[int, int] = transactions(addresses, lanes, access_bytes, rule)
        return found
    segment, request = SECTOR_BYTES, lanes
    if rule == LINES:
        segment = SEGMENT_BYTES
        if access_bytes > WORD_BYTES:
            request = max(1, 2 * HALF_WARP * WORD_BYTES // access_bytes)
    count, last = 0, -1
    for lane in range(lanes):
        if lane % request == 0:
            last = -1
        if addresses[lane] >= 0:
            here = addresses[lane] // segment
            count += here != last
            last = here
    return count, count * segment


@kernel(lent=True)
def record_sectors(
    active: Any, lanes: int, first: int, stride: int, words: int, word_bytes: int, rule: int, scratch: Any
) -> tuple[int, int]:
    """Transactions, and their bytes, of active lanes that each touch the words of a record of their own.

    Parameters
    ----------
    active : ndarray, (>= lanes,), int64
        Not 0 where a lane takes part.
    lanes : int
    first : int
        Record of lane 0.
    stride : int
        Bytes of a record.
    words, word_bytes : int
        Instructions, and what each touches.
    rule : int
        A ``Coalescing``.
    scratch : ndarray, (>= lanes,), int64
    """
    count = total = 0
    for word in range(words):
        for lane in range(lanes):
            scratch[lane] = (first + lane) * stride + word * word_bytes if active[lane] else -1
        n, size = rising_transactions(scratch, lanes, word_bytes, rule)
        count += n
        total += size
    return count, total
