"""Depth formats of graphics interfaces: what a depth in [0, 1] is kept as, and in how many bytes."""

from typing import Any, Literal, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import float_bits

DepthFormat = Literal["fixed16", "fixed24", "fixed32", "float32"]
_F0, _F1 = np.float32(0), np.float32(1)


class Depths(NamedTuple):
    """A depth format: a depth of 1 in units of the last place (0: the bits of a float), what is cleared to, bytes."""

    scale: np.float32
    far: int
    bytes: int


DEPTHS = {
    "fixed16": Depths(np.float32(2**16 - 1), 2**16 - 1, 2),
    "fixed24": Depths(np.float32(2**24 - 1), 2**24 - 1, 4),  # beside 8 bits of stencil
    "fixed32": Depths(np.float32(2**32 - 256), 2**32 - 1, 4),  # the largest float32 below 2**32
    "float32": Depths(_F0, 0x3F800000, 4),
}


@kernel
def stored_depth(z: Any, scale: Any) -> Any:
    """NDC depth as it is kept, 0 nearest; larger is farther in every format."""
    unit = min(max(z * np.float32(0.5) + np.float32(0.5), _F0), _F1)
    if not unit >= _F0:  # NaN saturates to 0
        return np.int64(0)
    if scale == _F0:
        return float_bits(unit)
    return np.int64(np.rint(np.float64(unit * scale)))
