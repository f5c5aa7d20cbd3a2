"""Shared memory: how many passes one access of a warp takes.

Consecutive 4-byte words lie in consecutive banks, and a bank serves one word a pass. Lanes that read the same word
share it (broadcast); lanes that want different words of one bank wait for each other. ``bank_lanes`` lanes go
together: the half-warp on 1.x (16 banks), the warp from 2.0 on (32 banks). Atomics do not share: two lanes at the
same word take two passes (measured on an H200: atomicAdd of 32 lanes on one word, 32 clocks).
(On 1.x only one word a pass can be broadcast; we let any be, as 2.x does.)

An access is an int64 array of word indices, negative where a lane is inactive.
"""

from typing import Any

from tilestamp.models.kernel import kernel


@kernel
def bank_passes(words: Any, lanes: int, banks: int, bank_lanes: int) -> int:
    """Count the passes of one shared load or store: by group of ``bank_lanes``, the most distinct words in one bank.

    Parameters
    ----------
    words : ndarray, (>= lanes,), int64
        Index of the 4-byte word that each lane accesses; negative where it is inactive.
    lanes, banks, bank_lanes : int
        Lanes to look at (at most 64), banks, and lanes that go together (a ``Simt`` has both).
    """
    passes = 0
    for first in range(0, lanes, bank_lanes):
        passes += _group_passes(words, first, min(first + bank_lanes, lanes), banks, True)
    return passes


@kernel
def atomic_passes(words: Any, lanes: int, banks: int, bank_lanes: int) -> int:
    """Count the passes of one shared atomic: as ``bank_passes``, but lanes at the same word take a pass each."""
    passes = 0
    for first in range(0, lanes, bank_lanes):
        passes += _group_passes(words, first, min(first + bank_lanes, lanes), banks, False)
    return passes


@kernel
def bank_replays(words: Any, lanes: int, banks: int, bank_lanes: int) -> int:
    """Count the passes beyond the one that a group of lanes needs anyway: BANK_REPLAYS of a load or store."""
    replays = 0
    for first in range(0, lanes, bank_lanes):
        replays += max(0, _group_passes(words, first, min(first + bank_lanes, lanes), banks, True) - 1)
    return replays


@kernel
def _group_passes(words: Any, first: int, end: int, banks: int, broadcast: bool) -> int:
    """Most words, distinct if they are broadcast, that the lanes first..end-1 want from one bank."""
    most = 0
    counted = 0  # bit i: lane first + i wants a pass of its own
    for i in range(first, end):
        if words[i] < 0:
            continue
        bank = words[i] % banks
        rank = 1
        for j in range(first, i):
            if (counted >> (j - first)) & 1 and words[j] % banks == bank:
                if broadcast and words[j] == words[i]:
                    rank = 0
                    break
                rank += 1
        if rank > 0:
            counted |= 1 << (i - first)
            most = max(most, rank)
    return most
