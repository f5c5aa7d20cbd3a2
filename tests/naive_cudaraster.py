"""Slow, obvious cudaraster: Python integers and fractions, a plain minimum a sample, no tiles and no queues.

Finite input only. ``draw`` gives the triangle and depth of each sample; later stages of the real one may not change it.
"""

from fractions import Fraction

DMIN, DMAX = 17600, 2**32 - 1 - 17600
PATTERN = {1: [0], 2: [0, 1], 4: [1, 3, 0, 2], 8: [7, 2, 4, 0, 6, 3, 1, 5]}


def rn(value):
    """Round a fraction to float32, half to even; overflow is not expected."""
    value = Fraction(value)
    if value == 0:
        return value
    magnitude = abs(value)
    exponent = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    while magnitude < Fraction(2) ** exponent:
        exponent -= 1
    while magnitude >= Fraction(2) ** (exponent + 1):
        exponent += 1
    unit = Fraction(2) ** (max(exponent, -126) - 23)
    return round(value / unit) * unit  # Python rounds halves to even


def fma(a, b, c):
    return rn(a * b + c)


def clamp_int(value, low, high):
    return min(max(value, low), high)


def snap(vertex, width, height):
    """Snapped x and y from the viewport's centre, and 1/w."""
    x, y, _, w = vertex
    inverse = rn(Fraction(1) / w)
    snapped = [clamp_int(round(rn(rn(c * inverse) * 8 * n)), -(2**31), 2**31 - 1) for c, n in ((x, width), (y, height))]
    return *snapped, inverse


def cross(ax, ay, bx, by):
    return ax * by - ay * bx


def clip(vertices):
    """Barycentric polygon of a triangle inside the frustum."""
    v0 = vertices[0]
    d1 = [rn(b - a) for a, b in zip(v0, vertices[1], strict=True)]
    d2 = [rn(b - a) for a, b in zip(v0, vertices[2], strict=True)]
    polygon = [(Fraction(0), Fraction(0)), (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1))]
    for axis in range(3):
        if all(v[3] >= abs(v[axis]) for v in vertices):
            continue
        for sign in (1, -1):
            plane = [rn(v0[3] + sign * v0[axis]), rn(d1[3] + sign * d1[axis]), rn(d2[3] + sign * d2[axis])]
            polygon = cut(polygon, plane)
    points = [tuple(fma(e, b[1], fma(d, b[0], v)) for v, d, e in zip(v0, d1, d2, strict=True)) for b in polygon]
    return [(points[0], points[i - 1], points[i]) for i in range(2, len(points))]


def cut(polygon, plane):
    """Clip a polygon at one plane, in barycentrics and float32."""
    values = [fma(plane[2], b[1], fma(plane[1], b[0], plane[0])) for b in polygon]
    kept = []
    for i in range(len(polygon)):
        a, b, av, bv = polygon[i - 1], polygon[i], values[i - 1], values[i]
        if av * bv < 0:
            t = rn(av / rn(av - bv))
            s = rn(1 - t)
            kept.append(tuple(fma(s, p, rn(t * q)) for p, q in zip(a, b, strict=True)))
        if bv >= 0:
            kept.append(b)
    return kept if len(kept) >= 3 else []


def subtriangles(vertices, width, height, release):
    """Snapped counter-clockwise sub-triangles: three (x, y, 1/w, z) each, absolute 1/16 pixel."""
    v = vertices
    for c in range(3):
        for sign in (1, -1):
            if all(p[3] < sign * p[c] for p in v):
                return []
    axes = (0, 1, 2) if release == "nvdiffrast" else (2,)
    fast = all(p[3] >= abs(p[c]) for p in v for c in axes)
    if fast and release == "1.1":
        numbers = [n for p in v for n in snap(p, width, height)[:2]]
        fast = min(numbers) >= -32768 and max(numbers) <= 32767 and max(numbers) - min(numbers) <= 32767
    out = []
    for corners in [v] if fast else clip(v):
        points = [(*snap(p, width, height), p[2]) for p in corners]
        area = cross(*(points[1][k] - points[0][k] for k in (0, 1)), *(points[2][k] - points[0][k] for k in (0, 1)))
        if area == 0 or (area < 0 and release == "1.1"):
            continue
        if area < 0:
            points = [points[0], points[2], points[1]]
        out.append([(x + 8 * width, y + 8 * height, r, z) for x, y, r, z in points])
    return out


def float_bits(value):
    """Biased exponent and 24-bit mantissa of a positive normal float32."""
    exponent = value.numerator.bit_length() - value.denominator.bit_length()
    if Fraction(2) ** exponent > value:
        exponent -= 1
    return exponent + 127, int(value / Fraction(2) ** (exponent - 23))


def depth_plane(points, s):
    """Integer plane of depth: x, y and base modulo 2**32."""
    zs = [fma(rn(z * 2147465984), r, 2147483648) for _, _, r, z in points]
    (x0, y0), (x1, y1), (x2, y2) = (p[:2] for p in points)
    e1x, e1y, e2x, e2y = x1 - x0, y1 - y0, x2 - x0, y2 - y0
    exponent, mantissa = float_bits(rn(Fraction(1) / rn(cross(e1x, e1y, e2x, e2y))))
    shift = 150 - exponent
    sh = clamp_int(float_bits(max(zs))[0] - 149, 0, 8) if max(zs) > 0 else 0
    t0, t1, t2 = (clamp_int(int(z), 0, 2**32 - 1) >> sh for z in zs)
    t1, t2 = t1 - t0, t2 - t0
    xc, yc = (t1 * e2y - t2 * e1y) * mantissa, (t2 * e1x - t1 * e2x) * mantissa
    px, py = (c >> (shift - (sh + 4 - s)) for c in (xc, yc))
    ox, oy = x0 - (1 << (3 - s)), y0 - (1 << (3 - s))
    cx = (2 * ox + min(e1x, e2x, 0) + max(e1x, e2x, 0)) >> (5 - s)
    cy = (2 * oy + min(e1y, e2y, 0) + max(e1y, e2y, 0)) >> (5 - s)
    vx, vy = ox - (cx << (4 - s)), oy - (cy << (4 - s))
    base = (t0 << sh) - (((xc >> 13) * vx + (yc >> 13) * vy) >> (shift - (sh + 13))) - (px * cx + py * cy)
    return px, py, base


def covers(points, x, y):
    """Whether a point in 1/16 pixel is inside, by the tie rule."""
    for k in range(3):
        (ax, ay), (bx, by) = points[k][:2], points[(k + 1) % 3][:2]
        dx, dy = bx - ax, by - ay
        exclusive = dy > 0 or (dy == 0 and dx <= 0)
        if cross(ax - x, ay - y, dx, dy) < (1 if exclusive else 0):
            return False
    return True


def draw(positions, triangles, width, height, *, release="1.1", samples=1):
    """Triangle (-1 for none) and depth of each sample: dicts by (sample, row from below, column)."""
    s = samples.bit_length() - 1
    ids, depths = {}, {}
    for t, corners in enumerate(triangles.tolist()):
        vertices = [tuple(Fraction(float(c)) for c in positions[v]) for v in corners]
        for points in subtriangles(vertices, width, height, release):
            zx, zy, zb = depth_plane(points, s)
            for j in range(height):
                for i in range(width):
                    for k in range(samples):
                        sx, sy = i * samples + PATTERN[samples][k], j * samples + k
                        step = 16 // samples
                        if not covers(points, sx * step + step // 2, sy * step + step // 2):
                            continue
                        depth = (zx * sx + zy * sy + zb) % 2**32
                        old = depths.get((k, j, i), DMAX)
                        if depth < old or (depth == old and release == "nvdiffrast"):
                            ids[k, j, i], depths[k, j, i] = t, depth
    return ids, depths
