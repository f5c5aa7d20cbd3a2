"""Depth as the original keeps it in its buffers: 24 bits of an unsigned integer, rounded down (Zhang 2025)."""

from typing import Any

import numpy as np
from numba import njit

DEPTH_STEPS = np.float32(2**24 - 1)
NO_DEPTH = 2**32 - 1  # cleared to
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def depth_24_bit(z: Any) -> int:
    """Round a depth in [0, 1] as the original keeps it."""
    return int(min(max(z, _ZERO), _ONE) * DEPTH_STEPS)
