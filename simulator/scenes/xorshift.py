"""The random numbers of CudaRaster's benchmark: a lagged sum with rotation, seeded by xorshift.

Specification: notes on Laine & Karras 2011, section 8. Draw n is rotl32(x[n-11] + x[n-7], 13).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel

WORDS = 11  # words of state, then one more: the place of the next draw
SHORT_LAG_PLACE = 7
AUTHORS_SEED = 123
MASK = np.uint64(0xFFFFFFFF)


@kernel
def _draw(state: Any, numbers: Any) -> None:
    """Fill ``numbers`` with the next draws, in place."""
    place = state[WORDS]
    for i in range(numbers.size):
        partner = (place + np.uint32(SHORT_LAG_PLACE)) % np.uint32(WORDS)
        total = (np.uint64(state[place]) + np.uint64(state[partner])) & MASK
        value = ((total << np.uint64(13)) & MASK) | (total >> np.uint64(19))
        state[place] = value
        place = np.uint32((place + np.uint32(WORDS - 1)) % np.uint32(WORDS))
        numbers[i] = value
    state[WORDS] = place


def random_state(seed: int = AUTHORS_SEED) -> NDArray[np.uint32]:
    """Give the state right after seeding: 11 words by xorshift, then 11 draws thrown away.

    Parameters
    ----------
    seed : int
        Not 0 modulo 2**32: xorshift stays at 0.
    """
    word = seed & int(MASK)
    state = np.zeros(WORDS + 1, dtype=np.uint32)
    for i in range(WORDS):
        word ^= (word << 13) & int(MASK)
        word ^= word >> 17
        word ^= (word << 5) & int(MASK)
        state[i] = word
    draw_words(state, WORDS)
    return state


def draw_words(state: NDArray[np.uint32], count: int) -> NDArray[np.uint32]:
    """Give the next ``count`` draws, (count,) uint32, and move ``state`` on."""
    numbers = np.empty(count, dtype=np.uint32)
    _draw(state, numbers)
    return numbers


def draw_floats(state: NDArray[np.uint32], count: int) -> NDArray[np.float32]:
    """Give the next ``count`` draws in [0, 1], (count,) float32: each word rounded to float32, times 2**-32."""
    return draw_words(state, count).astype(np.float32) * np.float32(2.0**-32)
