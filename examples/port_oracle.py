"""An oracle for ports: random scenes through somebody's rasterizer and through ours, differences classified by cause.

Give ``check`` a function ``port(pos, tri, (height, width)) -> ids`` (triangle + 1 by pixel, row 0 at y = -1). As an
example this file holds a port with three bugs; ``python examples/port_oracle.py`` shows what the oracle says of each.

The causes, in the order in which they are tried, of a pixel where the two show different triangles:

clipping      one of them crosses a side of the frustum or the eye plane
depth order   both cover the pixel's centre, and the port shows the farther one
fill rule     the centre lies on an edge of one of them
precision     what is left: the centre is near an edge (positions are snapped to 1/16 pixel), or depths nearly equal
"""

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator import nvdiffrast as dr

Port = Callable[[NDArray[np.float32], NDArray[np.int32], tuple[int, int]], NDArray[np.int32]]
SUBPIXEL, ROUNDING = 1 / 16, 1e-6


def scene(seed: int, kind: str, count: int = 60) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Random clip-space triangles: ``inside`` the frustum, on a ``grid`` of pixels, or ``near`` the eye plane."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-0.95, 0.95, (3 * count, 2))
    if kind == "grid":
        xy = (np.floor(xy * 16) + 0.5) / 16  # pixel centres of 32 x 32
    z, w = rng.uniform(-0.9, 0.9, (3 * count, 1)), np.ones((3 * count, 1))
    if kind == "near":
        w = rng.uniform(-0.5, 2, (3 * count, 1))
    pos = np.column_stack([xy * w, z * w, w])
    return pos.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def edges_at(
    corners: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], size: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of places to the nearest edge of a triangle, in pixels, inside positive; and z/w there."""
    height, width = size
    ratio = corners[:, :3] / corners[:, 3:]
    a, b, c = (ratio[:, :2] + 1) * [width / 2, height / 2]
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    crosses = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((b, c), (c, a), (a, b))]
    lengths = [max(float(np.hypot(*(q - p))), 1e-12) for p, q in ((b, c), (c, a), (a, b))]
    distances = [np.sign(area) * cross / length for cross, length in zip(crosses, lengths, strict=True)]
    depth = sum(cross / (area or np.nan) * z for cross, z in zip(crosses, ratio[:, 2], strict=True))
    return np.minimum.reduce(distances), np.asarray(depth)


def cause(
    pos: NDArray[np.float32], tri: NDArray[np.int32], ours: int, theirs: int, at: tuple[int, int], size: tuple[int, int]
) -> str:
    """Why two rasterizers show different triangles (numbers + 1, 0 for none) at a pixel (row, column)."""
    shown = [pos[tri[t - 1]].astype(np.float64) for t in (ours, theirs) if t]
    if any((np.abs(corners[:, :3]) > corners[:, 3:]).any() for corners in shown):
        return "clipping"
    y, x = np.array(at) + 0.5
    distances, depths = zip(*(edges_at(corners, x, y, size) for corners in shown), strict=True)
    if ours and theirs and min(distances) > SUBPIXEL and depths[1] > depths[0] + ROUNDING:
        return "depth order"
    return "fill rule" if min(np.abs(distances)) < ROUNDING else "precision"


def check(
    port: Port,
    seeds: range = range(6),
    size: tuple[int, int] = (32, 32),
    kinds: tuple[str, ...] = ("inside", "grid", "near"),
) -> Counter[str]:
    """Count the pixels of random scenes in which a port differs, by cause, and all pixels as ``pixels``."""
    causes: Counter[str] = Counter()
    for seed in seeds:
        for kind in kinds:
            pos, tri = scene(seed, kind)
            ours = dr.rasterize(pos[None], tri, size)[0][0, ..., 3].astype(int)
            theirs = port(pos, tri, size)
            causes["pixels"] += ours.size
            for j, i in np.argwhere(ours != theirs):
                causes[cause(pos, tri, int(ours[j, i]), int(theirs[j, i]), (int(j), int(i)), size)] += 1
    return causes


def ours(pos: NDArray[np.float32], tri: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """A port without a bug."""
    return dr.rasterize(pos[None], tri, size)[0][0, ..., 3].astype(np.int32)


def open_edges(pos: NDArray[np.float32], tri: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """A port without clipping, snapping and a fill rule: a pixel on an edge belongs to both sides."""
    ids, nearest = np.zeros(size, np.int32), np.full(size, np.inf)
    y, x = np.mgrid[: size[0], : size[1]] + 0.5
    for t, corners in enumerate(pos[tri].astype(np.float64)):
        if (np.abs(corners[:, :3]) > corners[:, 3:]).any():
            continue
        distance, depth = edges_at(corners, x, y, size)
        shown = (distance >= 0) & (depth <= nearest)
        ids[shown], nearest[shown] = t + 1, depth[shown]
    return ids


def painters(pos: NDArray[np.float32], tri: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """A port without a depth test: the last triangle shows."""
    ids = np.zeros(size, np.int32)
    for t in range(len(tri)):
        ids[ours(pos, tri[t : t + 1], size) > 0] = t + 1
    return ids


def no_clipping(pos: NDArray[np.float32], tri: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """A port that drops triangles which are not inside the frustum instead of clipping them."""
    inside = (np.abs(pos[tri][..., :3]) <= pos[tri][..., 3:]).all(axis=(1, 2))
    kept = ours(pos, tri[inside], size)
    numbers = np.concatenate([[0], np.flatnonzero(inside) + 1])
    return numbers[kept].astype(np.int32)


if __name__ == "__main__":
    for name, port in {
        "no bug": ours,
        "edges drawn twice": open_edges,
        "no depth test": painters,
        "no clipping": no_clipping,
    }.items():
        found = check(port)
        pixels = found.pop("pixels")
        told = ", ".join(f"{cause} {count}" for cause, count in found.most_common()) or "none"
        print(f"{name}: of {pixels} pixels differ: {told}")
