"""The order of the shuffled scenes: the measurement's own shuffle, by the 64-bit Mersenne twister of C++."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

SEED = 20100503
_WORDS, _MIDDLE = 312, 156
_ALL = (1 << 64) - 1
_MATRIX = 0xB5026F5AA96619E9


def mersenne_twister_64(seed: int) -> Iterator[int]:
    """Numbers of ``std::mt19937_64`` (Nishimura & Matsumoto 2000)."""
    state = [seed]
    for i in range(1, _WORDS):
        state.append((6364136223846793005 * (state[-1] ^ (state[-1] >> 62)) + i) & _ALL)
    while True:
        for i in range(_WORDS):
            x = (state[i] & ~0x7FFFFFFF & _ALL) | (state[(i + 1) % _WORDS] & 0x7FFFFFFF)
            state[i] = state[(i + _MIDDLE) % _WORDS] ^ (x >> 1) ^ (_MATRIX if x & 1 else 0)
        for word in state:
            x = word ^ (word >> 29) & 0x5555555555555555
            x ^= (x << 17) & 0x71D67FFFEDA60000
            x ^= (x << 37) & 0xFFF7EEE000000000 & _ALL
            yield (x ^ (x >> 43)) & _ALL


def shuffled(count: int) -> NDArray[np.int64]:
    """Old index of each patch in the shuffled queue."""
    order = list(range(count))
    numbers = mersenne_twister_64(SEED)
    for i in range(count - 1, 0, -1):
        j = next(numbers) % (i + 1)
        order[i], order[j] = order[j], order[i]
    return np.array(order)
