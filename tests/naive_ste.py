"""Slow, obvious versions of what measures sample test efficiency: subdivision by dictionaries, coverage by ints."""

import math
from fractions import Fraction

SUB = 4096  # sub-pixel steps: the definition that the kernels share


def catmull_clark(points, faces, creases=None):
    """One step on dictionaries and exact fractions; points are tuples, faces tuples of vertex numbers."""
    creases = creases or {}
    points = [tuple(Fraction(x) for x in p) for p in points]
    mean = lambda ps: tuple(sum(c) / len(ps) for c in zip(*ps, strict=True))  # noqa: E731
    face_points = [mean([points[v] for v in face]) for face in faces]
    around_edge = {}
    around_vertex = {}
    for f, face in enumerate(faces):
        for v, w in zip(face, face[1:] + face[:1], strict=True):
            around_edge.setdefault(frozenset((v, w)), []).append(f)
            around_vertex.setdefault(v, []).append(f)
    sharp = {e: math.inf if len(fs) == 1 else creases.get(e, 0) for e, fs in around_edge.items()}
    edge_points = {}
    for edge, fs in around_edge.items():
        ends = [points[v] for v in edge]
        smooth = mean([*ends, *(face_points[f] for f in fs)])
        s = Fraction(min(sharp[edge], 1))
        edge_points[edge] = tuple(s * m + (1 - s) * x for m, x in zip(mean(ends), smooth, strict=True))
    moved = {}
    for v, fs in around_vertex.items():
        mine = [e for e in around_edge if v in e]
        hard = [e for e in mine if sharp[e] > 0]
        middles = mean([mean([points[w] for w in e]) for e in mine])
        n = len(mine)
        smooth = tuple(
            (f + 2 * r + (n - 3) * p) / n
            for f, r, p in zip(mean([face_points[f] for f in fs]), middles, points[v], strict=True)
        )
        held, weight = smooth, Fraction(0)
        if len(hard) >= 2:
            weight = sum(Fraction(min(sharp[e], 1)) for e in hard) / len(hard)
            far = [points[next(w for w in e if w != v)] for e in hard]
            held = tuple((6 * p + sum(c)) / 8 for p, *c in zip(points[v], *far, strict=True))
            if len(hard) > 2 or (len(fs) == 1 and all(sharp[e] == math.inf for e in hard)):
                held = points[v]
        moved[v] = tuple(weight * h + (1 - weight) * s for h, s in zip(held, smooth, strict=True))
    quads = []
    for f, face in enumerate(faces):
        for k, v in enumerate(face):
            after, before = face[(k + 1) % len(face)], face[k - 1]
            quads.append(
                [moved[v], edge_points[frozenset((v, after))], face_points[f], edge_points[frozenset((before, v))]]
            )
    return [[tuple(map(float, p)) for p in quad] for quad in quads]


def snapped(polygon):
    return [(math.floor(float(x) * SUB + 0.5), math.floor(float(y) * SUB + 0.5), float(z)) for x, y, z in polygon]


def triangle_at(a, b, c, x, y):
    """Depth of a triangle at a sample, None where it does not cover it: top-left rule, whole numbers."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0:
        return None
    values = []
    for p, q in ((a, b), (b, c), (c, a)):
        sign = 1 if area > 0 else -1
        right, down = sign * (p[1] - q[1]), sign * (q[0] - p[0])
        value = right * (x - p[0]) + down * (y - p[1])
        owned = right > 0 or (right == 0 and down > 0)
        if value < 0 or (value == 0 and not owned):
            return None
        values.append(value)
    ab, bc, ca = map(float, values)
    return (bc * a[2] + ca * b[2] + ab * c[2]) / (bc + ca + ab)


def cover(polygon, x, y):
    """Depth of a polygon of 3 or 4 corners at a sample in sub-pixel steps, or None."""
    corners = snapped(polygon)
    for k in range(1, len(corners) - 1):
        depth = triangle_at(corners[0], corners[k], corners[k + 1], x, y)
        if depth is not None:
            return depth
    return None


def render(polygons, width, height, offsets):
    """Nearest polygon of each sample, [y][x][s], -1 where none; and how many samples each polygon covers."""
    import numpy as np

    ids = [[[-1] * len(offsets) for _ in range(width)] for _ in range(height)]
    best = {}
    hits = [0] * len(polygons)
    for p, polygon in enumerate(polygons):
        for y in range(height):
            for x in range(width):
                for s, (dx, dy) in enumerate(offsets):
                    depth = cover(polygon, x * SUB + int(dx), y * SUB + int(dy))
                    if depth is None:
                        continue
                    hits[p] += 1
                    depth = np.float32(depth)
                    if depth < best.get((x, y, s), math.inf):
                        best[x, y, s] = depth
                        ids[y][x][s] = p
    return ids, hits


def box_stamps(polygon, width, height, wide, high):
    """Stamps (column, row) that touch a polygon's box on screen."""
    xs, ys = [c[0] for c in snapped(polygon)], [c[1] for c in snapped(polygon)]
    x0, x1 = max(min(xs), 0), min(max(xs), width * SUB - 1)
    y0, y1 = max(min(ys), 0), min(max(ys), height * SUB - 1)
    if x1 < x0 or y1 < y0:
        return []
    columns = range(x0 // (wide * SUB), x1 // (wide * SUB) + 1)
    return [(i, j) for j in range(y0 // (high * SUB), y1 // (high * SUB) + 1) for i in columns]


def clipped(polygon, x0, y0, x1, y1):
    """Part of a convex polygon inside a rectangle, by exact clipping."""
    points = [(Fraction(p[0]), Fraction(p[1])) for p in polygon]
    for axis, bound, keep in ((0, x0, 1), (0, x1, -1), (1, y0, 1), (1, y1, -1)):
        out = []
        for p, q in zip(points, points[1:] + points[:1], strict=True):
            a, b = keep * (p[axis] - bound), keep * (q[axis] - bound)
            if a >= 0:
                out.append(p)
            if a * b < 0:
                t = a / (a - b)
                out.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        points = out
        if not points:
            return []
    return points


def reaches(polygon, i, j, wide, high):
    """Whether a polygon reaches into a stamp: a triangle of it has points there."""
    corners = snapped(polygon)
    square = (i * wide * SUB, j * high * SUB, (i + 1) * wide * SUB - 1, (j + 1) * high * SUB - 1)
    for k in range(1, len(corners) - 1):
        a, b, c = corners[0], corners[k], corners[k + 1]
        if (b[0] - a[0]) * (c[1] - a[1]) != (b[1] - a[1]) * (c[0] - a[0]) and clipped([a, b, c], *square):
            return True
    return False


def mask_tests(polygons, patches, width, height, offsets):
    """Count tests and new hits of the plain bit mask in sequence."""
    tests = hits = 0
    mask = set()
    for p, polygon in enumerate(polygons):
        if p and patches[p] != patches[p - 1]:
            mask = set()
        for i, j in box_stamps(polygon, width, height, 1, 1):
            for s, (dx, dy) in enumerate(offsets):
                if (i, j, s) in mask:
                    continue
                tests += 1
                if cover(polygon, i * SUB + int(dx), j * SUB + int(dy)) is not None:
                    hits += 1
                    mask.add((i, j, s))
    return tests, hits
