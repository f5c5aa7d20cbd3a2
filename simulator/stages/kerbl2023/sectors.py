"""Transactions of a warp whose lanes touch rising addresses, as records by the lane's number do.

A transaction is the machine's smallest: a sector of 32 bytes, a line of 128 where loads go through lines.
"""

from typing import Any

from tilestamp.models.kernel import kernel


@kernel(lent=True)
def record_sectors(active: Any, lanes: int, first: int, stride: int, words: int, word_bytes: int, segment: int) -> int:
    """Transactions of active lanes that each touch the words of a record of their own.

    Parameters
    ----------
    active : ndarray, (>= lanes,), int64
        Not 0 where a lane takes part.
    lanes : int
    first : int
        Record of lane 0.
    stride : int
        Bytes of a record; 0 where all touch the same.
    words, word_bytes : int
        Instructions, and what each touches.
    segment : int
        Bytes of a transaction.
    """
    count = 0
    for word in range(words):
        last = -1
        for lane in range(lanes):
            if active[lane]:
                here = ((first + lane) * stride + word * word_bytes) // segment
                count += here != last
                last = here
    return count
