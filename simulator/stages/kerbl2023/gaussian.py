"""One Gaussian on the screen, operation by operation in float32.

Compiled CUDA fuses products into sums: of a sum of three products the middle one is rounded alone, then the first is
fused, then the third.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import fma, fma64

NEAR = np.float32(0.2)  # what lies nearer is not drawn
LOW_PASS = np.float32(0.3)  # square pixels added to the variance on the screen
SLANT = np.float32(1.3)  # times the field of view: beyond, the projection is taken as at its edge
SIGMAS = np.float32(3.0)  # half the side of the square, in standard deviations
LEAST = np.float32(0.1)  # of the squared difference of the variances
_ZERO, _HALF, _ONE, _TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)
_TINY = np.float32(1e-7)


class Lens(NamedTuple):
    """A camera and its screen, as kernels take it."""

    to_camera: NDArray[np.float32]  # (4, 4)
    to_clip: NDArray[np.float32]
    focal_x: np.float32  # pixels
    focal_y: np.float32
    limit_x: np.float32  # largest slope at which the projection is linearized
    limit_y: np.float32
    width: int  # pixels
    height: int


@kernel(lent=True, inline=True)
def dot(a: Any, b: Any, c: Any, x: Any, y: Any, z: Any) -> Any:
    """Sum of three products, as it is compiled."""
    return fma(c, z, fma(a, x, b * y))


@kernel(lent=True, inline=True)
def row_dot(matrix: Any, row: int, x: Any, y: Any, z: Any) -> Any:
    """A row of a matrix times a point: the last column is added to the rounded sum."""
    return dot(matrix[row, 0], matrix[row, 1], matrix[row, 2], x, y, z) + matrix[row, 3]


@kernel(lent=True, inline=True)
def covariance(s0: Any, s1: Any, s2: Any, r: Any, a: Any, b: Any, c: Any) -> Any:
    """Covariance in space, 00 01 02 11 12 22, of three scales and a quaternion (r; a, b, c) that need not be a unit."""
    cc, bb, ca, cr, ar = c * c, b * b, c * a, c * r, a * r
    a0, a1, a2 = s0 * (_ONE - _TWO * (bb + cc)), s1 * (_TWO * fma(b, a, -cr)), s2 * (_TWO * fma(b, r, ca))
    b0, b1, b2 = s0 * (_TWO * fma(b, a, cr)), s1 * (_ONE - _TWO * fma(a, a, cc)), s2 * (_TWO * fma(b, c, -ar))
    c0, c1, c2 = s0 * (_TWO * fma(b, -r, ca)), s1 * (_TWO * fma(b, c, ar)), s2 * (_ONE - _TWO * fma(a, a, bb))
    return (
        dot(a0, a1, a2, a0, a1, a2),
        dot(a0, a1, a2, b0, b1, b2),
        dot(a0, a1, a2, c0, c1, c2),
        dot(b0, b1, b2, b0, b1, b2),
        dot(b0, b1, b2, c0, c1, c2),
        dot(c0, c1, c2, c0, c1, c2),
    )


@kernel(lent=True, error_model="numpy")
def on_screen(lens: Lens, x: Any, y: Any, z: Any, depth: Any, space: Any) -> Any:
    """Covariance on the screen, xx xy yy in square pixels, of a Gaussian at a point."""
    s00, s01, s02, s11, s12, s22 = space
    view = lens.to_camera
    ex = min(lens.limit_x, max(-lens.limit_x, row_dot(view, 0, x, y, z) / depth)) * depth
    ey = min(lens.limit_y, max(-lens.limit_y, row_dot(view, 1, x, y, z) / depth)) * depth
    zz = depth * depth
    j00, j11 = lens.focal_x / depth, lens.focal_y / depth
    j02, j12 = -(ex * lens.focal_x) / zz, -(ey * lens.focal_y) / zz
    t0 = fma(j02, view[2, 0], view[0, 0] * j00)
    t1 = fma(j02, view[2, 1], view[0, 1] * j00)
    t2 = fma(j02, view[2, 2], view[0, 2] * j00)
    u0 = fma(j12, view[2, 0], view[1, 0] * j11)
    u1 = fma(j12, view[2, 1], view[1, 1] * j11)
    u2 = fma(j12, view[2, 2], view[1, 2] * j11)
    p0, p1, p2 = dot(t0, t1, t2, s00, s01, s02), dot(t0, t1, t2, s01, s11, s12), dot(t0, t1, t2, s02, s12, s22)
    q0, q1, q2 = dot(u0, u1, u2, s00, s01, s02), dot(u0, u1, u2, s01, s11, s12), dot(u0, u1, u2, s02, s12, s22)
    return (
        dot(t0, t1, t2, p0, p1, p2) + LOW_PASS,
        dot(t0, t1, t2, q0, q1, q2),
        dot(u0, u1, u2, q0, q1, q2) + LOW_PASS,
    )


@kernel(lent=True, inline=True, error_model="numpy")
def three_sigmas(cxx: Any, cyy: Any, det: Any) -> Any:
    """Half the side of the square around a Gaussian, in whole pixels as a float."""
    middle = _HALF * (cxx + cyy)
    spread = fma(middle, middle, -det)
    root = np.sqrt(max(LEAST, spread))
    return np.ceil(SIGMAS * np.sqrt(max(middle + root, middle - root)))


@kernel(lent=True, inline=True)
def pixel(ndc: Any, size: int) -> Any:
    """A clip-space coordinate in pixels, whose centres are whole numbers; computed in float64."""
    return np.float32(fma64(np.float64(ndc) + 1.0, np.float64(size), -1.0) * 0.5)
