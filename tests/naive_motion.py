"""Slow, obvious motion blur and defocus: polygons placed one by one, and every event of both algorithms."""

import numpy as np

from tests import naive_ste
from tests.naive_ste import SUB
from tests.naive_warps import WARP, Tally, one_test
from tilestamp.models.coalescing import contiguous


def placed(moving, p, time_lens):
    """Polygon p as a list of corners at a time and a lens point."""
    time, u, v = time_lens
    corners = moving.start[p].astype(float) + time * (moving.end[p] - moving.start[p])
    corners = corners.astype(np.float32)
    corners[:, :2] += moving.blur[p][:, None] * np.array([u, v])
    return corners.tolist()


def depth(moving, pattern, p, x, y, s):
    """Depth of a polygon at a sample, None where it is not there then."""
    i, j = y % len(pattern.place), x % len(pattern.place)
    dx, dy = (int(d) for d in pattern.place[i, j, s])
    return naive_ste.cover(placed(moving, p, pattern.time_lens[i, j, s]), x * SUB + dx, y * SUB + dy)


def swept_box(moving, p, low, high, width, height):
    """Pixels of the box that holds a polygon at all times and lens points from ``low`` to ``high`` (t, u, v)."""
    way = (moving.end[p] - moving.start[p])[:, :2].astype(float)
    at = [
        moving.start[p][:, :2] + t * way + moving.blur[p].astype(float)[:, None] * np.array([u, v])
        for t in (low[0], high[0])
        for u in (low[1], high[1])
        for v in (low[2], high[2])
    ]
    first = np.floor(np.min(at, axis=(0, 1)) - 1 / 64).astype(int)
    last = np.floor(np.max(at, axis=(0, 1)) + 1 / 64).astype(int)
    return [
        (x, y)
        for y in range(max(first[1], 0), min(last[1], height - 1) + 1)
        for x in range(max(first[0], 0), min(last[0], width - 1) + 1)
    ]


def interval(moving, pattern, width, height, count, simt):
    """Every event of intervals: neighbouring samples of a pixel share one of ``count``."""
    spp, tile = pattern.place.shape[2], len(pattern.place)
    shares = [range(n * spp // count, (n + 1) * spp // count) for n in range(count)]
    tally = Tally()
    for polygons in _warps(tally, moving, simt):
        for share in shares:
            values = pattern.time_lens[:, :, share.start : share.stop].reshape(-1, 3)
            low, high = values.min(axis=0), values.max(axis=0)
            boxes = [swept_box(moving, p, low, high, width, height) for p in polygons]
            walks = [[(x, y, s) for x, y in box for s in share] for box in boxes]
            for now in _lockstep(tally, polygons, walks, moving, pattern, width, simt):
                entries = [-1 if at is None else _entry(at, tile, spp) for at in now]
                tally.load(entries, 16, simt)
    return tally


def _entry(at, tile, spp):
    x, y, s = at
    return 16 * (spp * (tile * (y % tile) + x % tile) + s)


def interleaved(moving, pattern, width, height, simt):
    """Every event of interleaving."""
    tile = len(pattern.place)
    tally = Tally()
    for polygons in _warps(tally, moving, simt):
        for i, j, s in np.ndindex(pattern.time_lens.shape[:3]):
            still = [placed(moving, p, pattern.time_lens[i, j, s]) for p in polygons]
            boxes = [naive_ste.box_stamps(polygon, width, height, 1, 1) for polygon in still]
            walks = [[(x, y, s) for x, y in box if y % tile == i and x % tile == j] for box in boxes]
            for _ in _lockstep(tally, polygons, walks, moving, pattern, width, simt):
                pass
    return tally


def _warps(tally, moving, simt):
    """Polygons of each warp, their loads counted."""
    size = 28 * moving.start.shape[1]
    for first in range(0, len(moving.start), WARP):
        polygons = range(first, min(first + WARP, len(moving.start)))
        number, moved = contiguous(first * size, len(polygons) * size, int(simt.coalescing))
        tally.update(WARPS=1, POLYGONS=len(polygons), LOAD_TRANSACTIONS=number, LOAD_BYTES=moved)
        yield polygons


def _lockstep(tally, polygons, walks, moving, pattern, width, simt):
    """Walk all lanes together, counting; yields the sample of each lane at each step, None where it has none."""
    tally.update(BOX_WARPS=1, BOXES=len(polygons))
    spp = pattern.place.shape[2]
    for step in range(max(map(len, walks))):
        now = [walk[step] if step < len(walk) else None for walk in walks]
        tests = [(at, depth(moving, pattern, p, *at) is not None) for p, at in zip(polygons, now, strict=True) if at]
        one_test(tally, tests, width, spp, simt)
        yield now
