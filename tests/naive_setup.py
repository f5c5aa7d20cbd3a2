"""Slow, obvious counts of triangle setup: every event of a launch, by name (Laine & Karras 2011, section 3).

A thread has a triangle: it is outside a view plane, or snapped and culled whole, or clipped. Geometry is that of
``naive_cudaraster``, in fractions.
"""

from collections import Counter
from fractions import Fraction
from typing import NamedTuple

from tests import naive_cudaraster as naive
from tests.naive_buckets import store
from tests.naive_warps import Tally, groups


class Lane(NamedTuple):
    """What becomes of one triangle."""

    outcome: str  # outside, backface, between, kept or clipped
    first_outside: bool  # its first vertex lies outside the frustum
    sites: int = 0  # one or two sample sites in its box, else 0
    kept: int = 0  # sub-triangles
    fan: int = 0  # triangles of the clipped polygon
    walked: tuple = (0,) * 6  # polygon vertices at each plane


def lane_of(vertices, width, height, release, samples):
    """Follow one triangle."""
    outside = any(vertices[0][3] < abs(vertices[0][c]) for c in range(3))
    if any(all(p[3] < sign * p[c] for p in vertices) for c in range(3) for sign in (1, -1)):
        return Lane("outside", outside)
    guard = release == "1.1"
    if all(p[3] >= abs(p[c]) for p in vertices for c in ((2,) if guard else (0, 1, 2))):
        numbers = [naive.snap(p, width, height)[:2] for p in vertices]
        flat = [n for point in numbers for n in point]
        if not guard or (min(flat) >= -32768 and max(flat) <= 32767 and max(flat) - min(flat) <= 32767):
            outcome, sites = cull(numbers, width, height, release, samples)
            return Lane(outcome, outside, sites, int(outcome == "kept"))
    fans = naive.clip(vertices)
    corners = [[naive.snap(p, width, height)[:2] for p in triangle] for triangle in fans]
    kept = sum(cull(c, width, height, release, samples)[0] == "kept" for c in corners)
    return Lane("clipped", outside, 0, kept, len(fans), walked(vertices))


def cull(corners, width, height, release, samples):
    """Backfaces, and triangles between sample sites: one or two sites in the box, none of which is inside."""
    (x0, y0), (x1, y1), (x2, y2) = corners
    area = naive.cross(x1 - x0, y1 - y0, x2 - x0, y2 - y0)
    if area == 0 or (area < 0 and release == "1.1"):
        return "backface", 0
    points = corners if area > 0 else [corners[0], corners[2], corners[1]]
    step = 16 // samples  # sites lie at step / 2 from the lower left, a step apart
    moved = [(x + 8 * width, y + 8 * height) for x, y in points]
    columns, rows = ([p[i] for p in moved] for i in (0, 1))
    across, up = (
        list(range(-(-(min(axis) - step // 2) // step), (max(axis) - step // 2) // step + 1))
        for axis in (columns, rows)
    )
    sites = len(across) * len(up)
    if sites == 0:
        return "between", 0
    if sites > 2:
        return "kept", 0
    inside = [_holds(moved, x * step + step // 2, y * step + step // 2) for y in up for x in across]
    return ("kept" if any(inside) else "between"), 2 if sites == 2 and not inside[0] else 1


def _holds(corners, x, y):
    """Whether a site is inside or on an edge: only what surely covers none is culled."""
    edges = zip(corners, [*corners[1:], corners[0]], strict=True)
    return all(naive.cross(ax - x, ay - y, bx - x, by - y) >= 0 for (ax, ay), (bx, by) in edges)


def walked(vertices):
    """Vertices of the polygon at each of the six planes, 0 where the axis needs no clipping."""
    v0, steps = vertices[0], []
    d1, d2 = ([naive.rn(b - a) for a, b in zip(v0, v, strict=True)] for v in vertices[1:])
    polygon = [(Fraction(0), Fraction(0)), (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1))]
    for axis in range(3):
        needed = any(v[3] < abs(v[axis]) for v in vertices)
        for sign in (1, -1):
            steps.append(len(polygon) if needed and len(polygon) >= 3 else 0)
            if needed:
                plane = [naive.rn(c[3] + sign * c[axis]) for c in (v0, d1, d2)]
                polygon = naive.cut(polygon, plane)
    return tuple(steps)


def setup_counts(positions, triangles, width, height, release, samples, simt, *, depth=True, interpolate=True):
    """Every event of the launch."""
    tally = Tally()
    vertices = [[tuple(Fraction(float(c)) for c in positions[v]) for v in t] for t in triangles.tolist()]
    lanes = [lane_of(v, width, height, release, samples) for v in vertices]
    for warp in groups(range(len(lanes)), 32):
        tally += _warp([lanes[t] for t in warp])
        for k in range(3):
            tally.load([12 * t + 4 * k for t in warp], 4, simt)
            tally.load([16 * int(triangles[t, k]) for t in warp], 16, simt)
        store(tally, warp, 1, simt)
        store(tally, [16 * t if lanes[t].kept else -1 for t in warp], 16, simt)  # headers, or where those are
        words = 4 if release == "1.1" else 1
        for part in range(words):  # of 1.1's record, the first part is depth, the next two attributes
            if words == 1 or part == 3 or (interpolate if part else depth):
                mine = [16 * words * t + 16 * part if lanes[t].kept == 1 else -1 for t in warp]
                store(tally, mine, 16, simt)
        for t in warp:
            if lanes[t].kept > 1:  # headers and records in slots of its own, and where those are
                written = 2 * lanes[t].kept + 1
                tally += Counter(STORE_TRANSACTIONS=written, STORE_BYTES=32 * written)
    return tally


def _warp(lanes):
    """What 32 threads do, by the one that does most of it."""
    whole = [lane for lane in lanes if lane.outcome not in {"outside", "clipped"}]
    clipped = [lane for lane in lanes if lane.outcome == "clipped"]
    looked = [lane for lane in lanes if lane.outcome != "outside"]
    several = sum(lane.kept > 1 for lane in clipped)
    steps = [[lane.walked[plane] for lane in clipped] for plane in range(6)]
    count = Counter(lane.outcome for lane in lanes)
    return Counter(
        WARPS=1, TRIANGLE_LANES=len(lanes), VIEWPORT_CULLED=count["outside"], BACKFACE_CULLED=count["backface"],
        BETWEEN_CULLED=count["between"], SNAP_WARPS=int(bool(looked)), SNAP_LANES=len(looked),
        CLIP_WARPS=int(bool(clipped)), CLIP_LANES=len(clipped), CLIP_STEPS=sum(max(s, default=0) for s in steps),
        CLIP_STEP_LANES=sum(map(sum, steps)), FAN_STEPS=max((lane.fan for lane in clipped), default=0),
        FAN_LANES=sum(lane.fan for lane in clipped), STORE_STEPS=max(lane.kept for lane in lanes),
        STORE_LANES=sum(lane.kept for lane in lanes), ATOMIC=int(several > 0), ATOMIC_LANES=several,
        ATOMIC_REQUESTS=several, ATOMIC_CONFLICTS=max(several - 1, 0), ATOMIC_DEPTH=several,
        OUTSIDE_WARPS=int(any(lane.first_outside for lane in lanes)), CULLED_WARPS=int(count["outside"] > 0),
        SITE_WARPS=int(any(lane.sites for lane in lanes)), SITE_LANES=sum(lane.sites > 0 for lane in lanes),
        RETEST_WARPS=int(any(lane.sites > 1 for lane in lanes)), FAST_WARPS=int(bool(whole)), FAST_LANES=len(whole),
        CLIP_AXES=sum(any(lane.walked[2 * axis] for lane in clipped) for axis in range(3)),
    )  # fmt: skip
