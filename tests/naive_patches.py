"""Bound and split, and dice, slowly: plain Python floats, one sub-patch and one vertex at a time."""

import math


def bernstein(t):
    s = 1.0 - t
    return [s * s * s, 3 * t * s * s, 3 * t * t * s, t * t * t]


def surface(net, u, v):
    """Homogeneous point of a patch of 16 points, u along the columns."""
    bu, bv = bernstein(u), bernstein(v)
    return [sum(bv[y] * bu[x] * float(net[4 * y + x][d]) for y in range(4) for x in range(4)) for d in range(4)]


def halves(row):
    """De Casteljau at one half: the control points of both halves of a cubic."""
    mid = lambda p, q: [(a + b) / 2 for a, b in zip(p, q, strict=True)]  # noqa: E731 - a formula
    ab, bc, cd = mid(row[0], row[1]), mid(row[1], row[2]), mid(row[2], row[3])
    abc, bcd = mid(ab, bc), mid(bc, cd)
    middle = mid(abc, bcd)
    return [row[0], ab, abc, middle], [middle, bcd, cd, row[3]]


def quarters(net):
    """Give the four children of a net of 16 points, u first."""
    rows = [halves(net[4 * y : 4 * y + 4]) for y in range(4)]
    children = {}
    for i in range(2):
        columns = [halves([rows[y][i][x] for y in range(4)]) for x in range(4)]
        for j in range(2):
            children[i, j] = [columns[x][j][y] for y in range(4) for x in range(4)]
    return [children[0, 0], children[1, 0], children[0, 1], children[1, 1]]


def to_screen(net, matrix, width, height):
    """(x w, y w, w, z w) of each point, pixels from the top left corner."""
    out = []
    for point in net:
        x, y, z, w = (sum(float(matrix[r][c]) * float(point[c]) for c in range(4)) for r in range(4))
        out.append([(x + w) * width / 2, (w - y) * height / 2, w, z])
    return out


def decide(net, width, height, bound, whole_pixels):
    """0 to cull, 1 to keep, 4 to split."""
    outside = [
        [p[2] <= 0 for p in net],
        [p[0] < 0 for p in net],
        [p[0] > width * p[2] for p in net],
        [p[1] < 0 for p in net],
        [p[1] > height * p[2] for p in net],
    ]
    if any(all(side) for side in outside):
        return 0
    if any(p[2] <= 0 for p in net):
        return 4
    xs, ys = [p[0] / p[2] for p in net], [p[1] / p[2] for p in net]
    spans = [(min(xs), max(xs)), (min(ys), max(ys))]
    if whole_pixels:
        return 1 if all(math.floor(high) - math.floor(low) <= bound for low, high in spans) else 4
    return 1 if all(high - low < bound for low, high in spans) else 4


def bound_and_split(points, matrix, width, height, bound, whole_pixels=False, max_depth=14):
    """Give the final queue as (patch, level, i, j), and [length, culled, kept, split, given up] of each pass."""
    queue = [(p, 0, 0, 0, to_screen(net, matrix, width, height)) for p, net in enumerate(points)]
    passes = []
    while True:
        target, counts = [], [len(queue), 0, 0, 0, 0]
        for patch, level, i, j, net in queue:
            slots = decide(net, width, height, bound, whole_pixels)
            if slots == 4 and level == max_depth:
                counts[4] += 1
            elif slots == 4:
                counts[3] += 1
                for child, quarter in enumerate(quarters(net)):
                    target.append((patch, level + 1, 2 * i + child % 2, 2 * j + child // 2, quarter))
            else:
                counts[1 if slots == 0 else 2] += 1
                target += [(patch, level, i, j, net)] * slots
        passes.append(counts)
        queue = target
        if counts[3] == 0:
            return [entry[:4] for entry in queue], passes


def grid(net, level, i, j, matrix, width, height, side=4):
    """Screen x, y and depth of the vertices of a sub-patch, ``side`` a side."""
    vertices = []
    for row in range(side):
        for column in range(side):
            u, v = (i + column / (side - 1)) / 2**level, (j + row / (side - 1)) / 2**level
            x, y, w, z = to_screen([surface(net, u, v)], matrix, width, height)[0]
            vertices.append((x / w, y / w, z / w))
    return vertices
