"""Shared memory: how many passes one access of a warp takes, by the rule of the machine's generation.

A bank serves one row a pass, ``bank_bytes`` wide; lanes that want different rows of one bank wait for each other.
Consecutive words of ``bank_mode_bytes`` lie in consecutive banks (CUDA 4.2 guide, sections F.3.3, F.4.3, F.5.3; CUDA
11 guide, K.4.3 to K.7.3):

===========  =========================================================================================================
1.x          16 banks of 4 bytes, a half-warp at a time, in steps: a step serves all lanes at one word (broadcast) and
             one lane in each other bank. Which word and which lanes is not specified: here the first left. A wider
             access goes word by word.
2.x          32 banks of 4 bytes. Lanes at one word share it, in any number of banks at once. 8-byte accesses go by
             half-warps, 16-byte ones by quarter-warps (the guide counts two quarter-warps as a 2-way conflict).
3.x          32 banks of 8 bytes. In 4-byte mode (what CUDA sets) words i and i + 32 of an aligned 64-word row share a
             pass; in 8-byte mode the halves of one 8-byte word do. 256 bytes a pass: 8-byte accesses go by warps,
             16-byte ones by half-warps (measured on a K80: gpumembench, issue 1).
5.x, later   As 2.x (measured on an H200: 16 bytes a lane take four clocks. That it broadcasts one 16-byte vector to
             all lanes in two is not modelled.)
===========  =========================================================================================================

Atomics do not share: two lanes at the same word take two passes (measured on an H200: atomicAdd of 32 lanes on one
word, 32 clocks). Whether a row of 3.x takes atomics on both of its words at once is not published; here it does not.

An access is an int64 array with the index of the first 4-byte word of each lane, negative where a lane is inactive.
"""

from typing import Any

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt

WORD_BYTES = 4
HALF_WARP = 16  # lanes
MOST_WORDS = 64  # of one request: bits of a mask


@kernel
def bank_passes(words: Any, lanes: int, simt: Simt, access_words: int = 1) -> int:
    """Count the passes of one shared load, or of a store of each word by one lane.

    Parameters
    ----------
    words : ndarray, (>= lanes,), int64
        Index of the first 4-byte word that each lane accesses; negative where it is inactive.
    lanes : int
        Lanes to look at (at most 64).
    simt : Simt
        Banks, and lanes that go together.
    access_words : int
        Consecutive words that each lane accesses: 1, 2 or 4.
    """
    passes = 0
    if simt.bank_lanes == HALF_WARP:
        for first in range(0, lanes, HALF_WARP):
            for k in range(access_words):
                passes += _steps(words, first, min(first + HALF_WARP, lanes), k, simt.banks)
        return passes
    row_words = simt.banks * simt.bank_bytes // WORD_BYTES
    together = max(1, min(simt.bank_lanes, row_words // access_words, MOST_WORDS // access_words))
    for first in range(0, lanes, together):
        passes += _most_rows(words, first, min(first + together, lanes), access_words, simt)
    return passes


@kernel
def _steps(words: Any, first: int, end: int, offset: int, banks: int) -> int:
    """Steps that serve the lanes first..end-1 on 1.x: one word is broadcast, other banks serve a lane each."""
    steps = 0
    served = 0  # bit i: lane first + i
    while True:
        word = -1
        taken = 0  # bit b: bank b serves a lane in this step
        for i in range(first, end):
            if words[i] < 0 or (served >> (i - first)) & 1:
                continue
            wanted = words[i] + offset
            if word < 0:
                word = wanted
                taken |= 1 << (word % banks)
            elif wanted != word:
                if (taken >> (wanted % banks)) & 1:
                    continue
                taken |= 1 << (wanted % banks)
            served |= 1 << (i - first)
        if word < 0:
            return steps
        steps += 1


@kernel
def _most_rows(words: Any, first: int, end: int, access_words: int, simt: Simt) -> int:
    """Most distinct rows that the lanes first..end-1 want from one bank."""
    mode = simt.bank_mode_bytes // WORD_BYTES
    row_words = simt.banks * simt.bank_bytes // WORD_BYTES
    most = 0
    counted = 0  # bit n: the n-th word wants a pass of its own
    for n in range((end - first) * access_words):
        if words[first + n // access_words] < 0:
            continue
        word = words[first + n // access_words] + n % access_words
        rank = 1
        for m in range(n):
            if not (counted >> m) & 1:
                continue
            other = words[first + m // access_words] + m % access_words
            if (word // mode - other // mode) % simt.banks == 0:
                if word // row_words == other // row_words:
                    rank = 0
                    break
                rank += 1
        if rank > 0:
            counted |= 1 << n
            most = max(most, rank)
    return most
