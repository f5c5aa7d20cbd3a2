"""Slow, obvious versions of what the textured pipelines compute, in double precision and Python loops."""

import math

import numpy as np


def project(positions, matrix, width, height):
    """Vertices on the screen: x right, y down, depth in [0, 1], w; float64."""
    clip = positions.astype(np.float64) @ np.asarray(matrix, np.float64).T
    w = clip[:, 3]
    x = (clip[:, 0] / w + 1.0) * 0.5 * width
    y = (1.0 - clip[:, 1] / w) * 0.5 * height
    return np.stack([x, y, (clip[:, 2] / w + 1.0) * 0.5, w], axis=1)


def barycentric(corners, px, py):
    """Barycentric coordinates of a point, by solving the two equations; None for a triangle without area."""
    (ax, ay), (bx, by), (cx, cy) = ((c[0], c[1]) for c in corners)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == 0.0:
        return None
    b = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
    c = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / area
    return 1.0 - b - c, b, c


def faces_front(corners):
    """Whether the corners run counter-clockwise as seen (the screen's y points down)."""
    (ax, ay), (bx, by), (cx, cy) = ((c[0], c[1]) for c in corners)
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0.0


def draw(screen, triangles, width, height, *, culling=True):
    """Nearest triangle, its depth, and the smallest barycentric coordinate of any front triangle near each pixel.

    Returns ids (H, W), depth (H, W), and ``doubt`` (H, W): how near to an edge, or to another depth, the decision was.
    """
    ids = np.full((height, width), -1)
    depth = np.full((height, width), np.inf)
    doubt = np.full((height, width), np.inf)
    for t, triangle in enumerate(triangles):
        corners = screen[triangle]
        if culling and not faces_front(corners):
            continue
        low = np.floor(corners[:, :2].min(axis=0)).astype(int) - 1
        high = np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1
        for y in range(max(0, low[1]), min(height, high[1])):
            for x in range(max(0, low[0]), min(width, high[0])):
                weights = barycentric(corners, x + 0.5, y + 0.5)
                if weights is None:
                    continue
                doubt[y, x] = min(doubt[y, x], abs(min(weights)))
                z = sum(w * c[2] for w, c in zip(weights, corners, strict=True))
                if min(weights) >= 0.0 and 0.0 <= z < 1.0:
                    doubt[y, x] = min(doubt[y, x], abs(z - depth[y, x]))
                    if z < depth[y, x]:
                        ids[y, x], depth[y, x] = t, z
    return ids, depth, doubt


def perspective(corners, values, px, py):
    """Attribute of a triangle at a point: divided by w, interpolated, multiplied by the interpolated w."""
    weights = barycentric(corners, px, py)
    inverse = [c[3] ** -1 for c in corners]
    top = sum(w * q * np.asarray(v, np.float64) for w, q, v in zip(weights, inverse, values, strict=True))
    return top / sum(w * q for w, q in zip(weights, inverse, strict=True))


def bilinear(image, u, v):
    """Bilinear value of an image (H, W, 4) in [0, 1] at wrapping coordinates, in float64."""
    height, width = image.shape[:2]
    s, t = u * width - 0.5, v * height - 0.5
    x, y = math.floor(s), math.floor(t)
    total = np.zeros(4)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = (s - x if dx else 1.0 - (s - x)) * (t - y if dy else 1.0 - (t - y))
        total += weight * image[(y + dy) % height, (x + dx) % width].astype(np.float64)
    return total


def mip_chain(image):
    """All levels of an image whose sides are powers of two, float64."""
    chain = [image.astype(np.float64)]
    while max(chain[-1].shape[:2]) > 1:
        parent = chain[-1]
        rows, columns = max(1, parent.shape[0] // 2), max(1, parent.shape[1] // 2)
        level = np.zeros((rows, columns, 4))
        for y in range(rows):
            for x in range(columns):
                ys = [2 * y, 2 * y + 1] if parent.shape[0] > 1 else [0]
                xs = [2 * x, 2 * x + 1] if parent.shape[1] > 1 else [0]
                level[y, x] = np.mean([parent[j, i] for j in ys for i in xs], axis=0)
        chain.append(level)
    return chain


def trilinear(image, u, v, lod):
    """Trilinear value at a level of detail."""
    chain = mip_chain(image)
    low = min(int(lod), len(chain) - 1)
    high = min(low + 1, len(chain) - 1)
    blend = lod - int(lod)
    return (1.0 - blend) * bilinear(chain[low], u, v) + blend * bilinear(chain[high], u, v)


def over(fragments):
    """Blend (depth, id, rgba) of one pixel over black, farthest first."""
    color = np.zeros(3)
    for _, _, rgba in sorted(fragments, key=lambda f: (-f[0], f[1])):
        color = rgba[3] * np.asarray(rgba[:3]) + (1.0 - rgba[3]) * color
    return color
