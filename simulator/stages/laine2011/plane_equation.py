"""Plane equations in integers: value = x * X + y * Y + base, modulo 2**32 (cudaraster 1.1, triangle setup)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import biased_exponent, float_bits, greater, truncate_to_uint32

_LOW = 0xFFFFFFFF


@kernel(error_model="numpy", lent=True)
def reciprocal_area(area: int) -> Any:
    """1 / area as a 24-bit mantissa and a right shift."""
    bits = float_bits(np.float32(1) / np.float32(area))
    return (bits & 0x7FFFFF) | 0x800000, 150 - (bits >> 23)


@kernel(error_model="numpy", lent=True)
def plane_equation(
    u0: Any,
    u1: Any,
    u2: Any,
    origin_x: int,
    origin_y: int,
    e1x: int,
    e1y: int,
    e2x: int,
    e2y: int,
    mantissa: int,
    shift: int,
    s: int,
) -> Any:
    """Plane through three vertex values.

    Parameters
    ----------
    u0, u1, u2 : float32
        Values at the vertices.
    origin_x, origin_y : int
        Vertex 0 relative to the sampling origin, 1/16 pixel.
    e1x, e1y, e2x, e2y : int
        Edges from vertex 0, 1/16 pixel.
    mantissa, shift : int
        From ``reciprocal_area``.
    s : int
        Log2 of the samples along a pixel that the plane is evaluated at.

    Returns
    -------
    tuple of int
        x, y, base, each modulo 2**32.
    """
    sh = min(max(biased_exponent(greater(greater(u0, u1), u2)) - 149, 0), 8)
    t0 = truncate_to_uint32(u0) >> sh
    t1 = (truncate_to_uint32(u1) >> sh) - t0
    t2 = (truncate_to_uint32(u2) >> sh) - t0
    xc = (t1 * e2y - t2 * e1y) * mantissa
    yc = (t2 * e1x - t1 * e2x) * mantissa
    px = (xc >> (shift - (sh + 4 - s))) & _LOW
    py = (yc >> (shift - (sh + 4 - s))) & _LOW
    # the constant is taken near the centre of the box, where errors are smallest
    cx = (2 * origin_x + min(e1x, e2x, 0) + max(e1x, e2x, 0)) >> (5 - s)
    cy = (2 * origin_y + min(e1y, e2y, 0) + max(e1y, e2y, 0)) >> (5 - s)
    vx = origin_x - (cx << (4 - s))
    vy = origin_y - (cy << (4 - s))
    centre = ((xc >> 13) * vx + (yc >> 13) * vy) >> (shift - (sh + 13))
    base = ((t0 << sh) - centre - (px * cx + py * cy)) & _LOW
    return px, py, base
