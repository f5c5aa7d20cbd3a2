"""A number and how sure it is: 95 % intervals by Student's t."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_QUANTILES = np.array([12.706, 4.303, 3.182, 2.776])  # of t at 97.5 %, for 1 to 4 degrees of freedom
_Z = 1.959964
MARGIN = 1.1  # few units of a skewed count say too little of its spread (chosen on 300 seeds of teapot and spot)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Estimate(NamedTuple):
    """A number and its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the interval's width."""
        return (self.high - self.low) / 2

    @property
    def relative(self) -> float:
        """Half-width over value; 0 where both are 0."""
        return self.half_width / abs(self.value) if self.half_width else 0.0


class Totals(NamedTuple):
    """Estimated totals of several quantities: value, variance and degrees of freedom, (k,) each."""

    value: Floats
    variance: Floats
    freedom: Floats

    @property
    def half_width(self) -> Floats:
        """Of the 95 % intervals."""
        return MARGIN * t_quantile(self.freedom) * np.sqrt(self.variance)


def t_quantile(freedom: Floats) -> Floats:
    """Quantile of Student's t at 97.5 % (Cornish-Fisher, Abramowitz & Stegun 26.7.5; tabulated below 5)."""
    nu = np.maximum(np.asarray(freedom, np.float64), 1.0)
    z = _Z
    series = (
        z
        + (z**3 + z) / (4 * nu)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * nu**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * nu**3)
    )
    small = np.interp(nu, [1.0, 2.0, 3.0, 4.0], _QUANTILES)
    return np.where(nu <= len(_QUANTILES), small, series)
