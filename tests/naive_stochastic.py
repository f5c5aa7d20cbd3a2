"""Slow, obvious moving triangles: a line of sight through a triangle by Cramer's rule, in fractions."""

from fractions import Fraction

import numpy as np

from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS


def placed(triangles, p, time, lens_point):
    """Corners of triangle p at a time and a lens point: x w, y w, z, w as fractions."""
    aperture, focus = (Fraction(float(value)) for value in triangles.lens)
    corners = []
    for k in range(3):
        start, way = ([Fraction(float(v)) for v in triangles.corners[p, end, k]] for end in (0, 1))
        x, y, z, w = (a + time * b for a, b in zip(start, way, strict=True))
        u, v = lens_point
        corners.append((x + aperture * u * (w - focus), y + aperture * v * (w - focus), z, w))
    return corners


def determinant(a, b, c):
    """Of three columns."""
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1]) + c[0] * (a[1] * b[2] - a[2] * b[1])


def hit(triangles, pattern, p, x, y, s):
    """Depth of triangle p at a sample, None where it is not there: on an edge it lies a little right, and less down."""
    i, j = y % len(pattern.place), x % len(pattern.place)
    time, u, v = (Fraction(float(value)) for value in pattern.time_lens[i, j, s])
    corners = placed(triangles, p, time, (u, v))
    columns = [(c[0], c[1], c[3]) for c in corners]
    whole = determinant(*columns)
    if whole == 0:
        return None
    at_x, at_y = (
        start + Fraction(int(step), SUBPIXELS) for start, step in zip((x, y), pattern.place[i, j, s], strict=True)
    )
    shares = []
    for k in range(3):
        share = []
        for ray in ((at_x, at_y, 1), (1, 0, 0), (0, 1, 0)):  # the sample, then how the share grows right and down
            changed = list(columns)
            changed[k] = ray
            share.append(determinant(*changed) / whole)
        if share <= [0, 0, 0]:
            return None
        shares.append(share[0])
    z = sum(share * corner[2] for share, corner in zip(shares, corners, strict=True))
    return np.float32(0.5 + 0.5 * float(z)) if abs(z) <= 1 else None


def nearest(triangles, pattern, x, y, s):
    """Triangle that a sample sees, -1 for none."""
    shown, depth = -1, np.inf
    for p in range(len(triangles.corners)):
        found = hit(triangles, pattern, p, x, y, s)
        if found is not None and found < depth:
            shown, depth = p, found
    return shown


def stays_off(triangles, p, sides, interval):
    """Whether all corners lie beyond one plane at all ends of time and lens, in fractions and without a margin."""
    x0, y0, x1, y1 = sides
    ends = [
        placed(triangles, p, Fraction(time), (Fraction(u), Fraction(v)))
        for time in interval[:2] for u in interval[2:4] for v in interval[4:]
    ]  # fmt: skip
    corners = [corner for end in ends for corner in end]
    distances = [(x - x0 * w, x1 * w - x, y - y0 * w, y1 * w - y, z + w, w - z) for x, y, z, w in corners]
    return any(all(distance < 0 for distance in plane) for plane in zip(*distances, strict=True))
