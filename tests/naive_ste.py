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
