"""Depth as the original keeps it in its buffers: 24 bits of an unsigned integer, rounded down (Zhang 2025).

Early z and the ROP both take a fragment's depth from the same float plane, but the original does not evaluate it in the
same way: first, three pixels of a quad stepped from the fourth (``stepped``); a nearest fragment whose stepped depth
is a unit larger then fails the ROP's test against its own early z, and leaves a one-pixel hole. Later, 1e-4 was taken
off the depth that goes to the ROP (``biased``). With ``direct`` both evaluate the same expression.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import greater
from tilestamp.simulator.stages.zhang2025.triangle_setup import DEPTH, evaluate

DEPTH_STEPS = np.float32(2**24 - 1)
NO_DEPTH = 2**32 - 1  # cleared to
FRAGMENT_DEPTHS = {"direct": 0, "stepped": 1, "biased": 2}
_BIAS = np.float32(1e-4)
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@kernel(error_model="numpy", lent=True)
def depth_24_bit(z: Any) -> int:
    """Round a depth in [0, 1] as the original keeps it; what is not a number is 0."""
    return int(min(greater(z, _ZERO), _ONE) * DEPTH_STEPS)


@kernel(error_model="numpy", lent=True)
def fragment_depth(planes: Any, x: int, y: int, way: int) -> Any:
    """Depth of a fragment as the ROP gets it, by one of ``FRAGMENT_DEPTHS``."""
    plane = planes[DEPTH]
    if way != 1:
        z = evaluate(plane, np.float32(x) + _HALF, np.float32(y) + _HALF)
        return depth_24_bit(z - _BIAS if way == 2 else z)
    z = evaluate(plane, np.float32(x - x % 2) + _HALF, np.float32(y - y % 2) + _HALF)
    if y % 2:
        z += plane[1]
    if x % 2:
        z += plane[0]
    return depth_24_bit(z)
