"""Correctly rounded exp in float32, in plain Python; ``blend_step`` has the same as vector code.

exp is a polynomial in float64 with a relative error of 2e-16, rounded once: among the floats of the loop a wrong
rounding is expected in none of 10^8. The GPU's own exp is within 1 ulp of it.
"""

import numpy as np

# Interpolates exp at the Chebyshev nodes of |x| < 0.3467; largest relative error 1.6e-17.
POLYNOMIAL = (
    1.0, 1.0, 0.5000000000000019, 0.1666666666666668, 0.041666666666487655, 0.008333333333319566,
    0.0013888888952431778, 0.00019841269890137088, 2.4801485357120633e-05, 2.7557240822296773e-06,
    2.763268595522351e-07, 2.5110073222041883e-08,
)  # fmt: skip
LOG2_E = 1.4426950408889634
LN2_HIGH, LN2_LOW = 0.6931470632553101, 1.1730463525082348e-07
ROUND = 6755399441055744.0  # 1.5 * 2**52: adding and taking it away rounds a double to even
LEAST = -100.0  # below, nothing is visible


def exp32(power: np.float32) -> np.float32:
    """Exp of a float32 that is not positive; NaN stays NaN."""
    return np.float32(np.exp(np.float64(power)))
