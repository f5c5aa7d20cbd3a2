"""Exact coverage in Python's rationals: slow and obvious."""

from fractions import Fraction

import numpy as np


def covered(corners, x, y):
    """Whether a triangle of homogeneous corners covers the point (x, y, 1), y down, by the top-left rule."""
    a, b, c = ([Fraction(float(v)) for v in corner] for corner in corners)
    x, y = Fraction(float(x)), Fraction(float(y))
    sign = _sign(_det(a, b, c))
    if sign == 0:
        return False
    for p, q in ((b, c), (c, a), (a, b)):
        value = sign * _det(p, q, (x, y, Fraction(1)))
        right = sign * (p[1] * q[2] - p[2] * q[1])
        down = sign * (p[2] * q[0] - p[0] * q[2])
        owns = right > 0 or (right == 0 and down > 0)
        if value < 0 or (value == 0 and not owns):
            return False
    return True


def depth(corners, depths, x, y):
    """Depth, z / w, of the triangle's plane at (x, y, 1), exactly."""
    a, b, c = ([Fraction(float(v)) for v in corner] for corner in corners)
    point = (Fraction(float(x)), Fraction(float(y)), Fraction(1))
    parts = (_det(b, c, point), _det(c, a, point), _det(a, b, point))
    return sum(part * Fraction(float(z)) for part, z in zip(parts, depths, strict=True)) / _det(a, b, c)


def hits(corners, grid):
    """Triangles on each sample of a grid, (rows, columns)."""
    counts = np.zeros((grid.rows, grid.columns), np.int32)
    for j in range(grid.rows):
        for i in range(grid.columns):
            counts[j, i] = sum(covered(t, grid.x + i * grid.dx, grid.y + j * grid.dy) for t in corners)
    return counts


def _det(a, b, c):
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def _sign(value):
    return (value > 0) - (value < 0)
