"""Shared-memory passes from the words of the CUDA guides, slow and obvious: an oracle for ``models.banks``."""

from collections import defaultdict


def passes_1x(words, access_words):
    """Half-warps; word by word; at each step one word is broadcast, and every other bank serves a lane."""
    steps = 0
    for half in (words[:16], words[16:32]):
        for k in range(access_words):
            left = [word + k for word in half if word >= 0]
            while left:
                broadcast = left[0]
                banks = {broadcast % 16}
                kept = []
                for word in left:
                    if word == broadcast:
                        continue
                    if word % 16 in banks:
                        kept.append(word)
                    banks.add(word % 16)
                left = kept
                steps += 1
    return steps


def passes_4_byte(words, access_words):
    """32 banks of a word each: warps, half-warps or quarter-warps of 4-, 8- or 16-byte accesses."""
    return _most_in_a_bank(words, access_words, 32 // access_words, lambda word: (word % 32, word))


def passes_3x_4_byte_mode(words, access_words):
    """Two lanes conflict in a bank unless at one word, or at words i and i + 32 of an aligned 64."""
    return _most_in_a_bank(words, access_words, min(32, 64 // access_words), lambda word: (word % 32, word // 64))


def passes_3x_8_byte_mode(words, access_words):
    """Two lanes conflict in a bank unless at one 8-byte word."""
    return _most_in_a_bank(words, access_words, min(32, 64 // access_words), lambda word: (word // 2 % 32, word // 2))


def _most_in_a_bank(words, access_words, together, place):
    passes = 0
    for first in range(0, len(words), together):
        banks = defaultdict(set)
        for word in words[first : first + together]:
            for k in range(access_words if word >= 0 else 0):
                bank, row = place(word + k)
                banks[bank].add(row)
        passes += max((len(rows) for rows in banks.values()), default=0)
    return passes
