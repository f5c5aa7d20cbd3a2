"""Slow, obvious versions of scenes: splines by their definitions, subdivision by dictionaries, draws in integers."""

from __future__ import annotations

from collections import defaultdict


def bernstein(t):
    """Cubic Bernstein weights at t."""
    return [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3]


def bspline(t):
    """Uniform cubic B-spline weights at t, for the four knots' points around the span."""
    return [(1 - t) ** 3 / 6, (3 * t**3 - 6 * t * t + 4) / 6, (-3 * t**3 + 3 * t * t + 3 * t + 1) / 6, t**3 / 6]


def surface_point(net, rows, columns):
    """Weighted sum of a 4x4 net of points."""
    size = len(net[0][0])
    return [sum(rows[i] * columns[j] * net[i][j][axis] for i in range(4) for j in range(4)) for axis in range(size)]


def average(points):
    return [sum(values) / len(points) for values in zip(*points, strict=True)]


def catmull_clark(positions, faces):
    """One step for any polygons; old vertices come first, then a point an edge (sorted), then a point a face."""
    face_points = [average([positions[v] for v in face]) for face in faces]
    faces_of_edge, faces_of_vertex = defaultdict(list), defaultdict(list)
    for number, face in enumerate(faces):
        for here, there in zip(face, face[1:] + face[:1], strict=True):
            faces_of_edge[min(here, there), max(here, there)].append(number)
            faces_of_vertex[here].append(number)
    edges = sorted(faces_of_edge)
    edge_points = []
    for edge in edges:
        ends = [positions[v] for v in edge]
        inside = len(faces_of_edge[edge]) == 2
        edge_points.append(average(ends + [face_points[f] for f in faces_of_edge[edge]] if inside else ends))
    moved = []
    for vertex, old in enumerate(positions):
        around = faces_of_vertex[vertex]
        spokes = [edge for edge in edges if vertex in edge]
        rim = [edge for edge in spokes if len(faces_of_edge[edge]) != 2]
        if not around or (rim and (len(rim) != 2 or len(around) == 1)):
            moved.append(list(old))
        elif rim:
            others = [positions[a + b - vertex] for a, b in rim]
            moved.append([(6 * o + p + q) / 8 for o, p, q in zip(old, *others, strict=True)])
        else:
            n = len(around)
            middle = average([face_points[f] for f in around])
            ring = average([average([positions[v] for v in edge]) for edge in spokes])
            moved.append([(f + 2 * r + (n - 3) * o) / n for f, r, o in zip(middle, ring, old, strict=True)])
    number_of = {edge: len(positions) + i for i, edge in enumerate(edges)}
    quads = []
    for number, face in enumerate(faces):
        for i, corner in enumerate(face):
            ahead, behind = face[(i + 1) % len(face)], face[i - 1]
            quads.append(
                [
                    corner,
                    number_of[min(corner, ahead), max(corner, ahead)],
                    len(positions) + len(edges) + number,
                    number_of[min(corner, behind), max(corner, behind)],
                ]
            )
    return moved + edge_points + face_points, quads


def xorshift_draws(seed, count):
    """Give the benchmark's random words after seeding and eleven discarded draws, in Python integers."""
    mask, words, x = 0xFFFFFFFF, [], seed
    for _ in range(11):
        x ^= (x << 13) & mask
        x ^= x >> 17
        x ^= (x << 5) & mask
        words.append(x)
    first, second, draws = 0, 7, []
    for _ in range(11 + count):
        total = (words[first] + words[second]) & mask
        words[first] = ((total << 13) | (total >> 19)) & mask
        draws.append(words[first])
        first, second = (first - 1) % 11, (second - 1) % 11
    return draws[11:]
