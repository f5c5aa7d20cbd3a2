"""Slow, obvious decoupled shading: a dictionary in order of use is the cache."""

from collections import Counter, OrderedDict
from math import floor

import numpy as np

from tests import naive_motion, naive_ste
from tests.naive_ste import SUB

BATCH = 256


def shading(moving, pattern, width, height, rate, cache, decoupled):
    """Events by name, and the set of cells that was asked for."""
    tally, nearest, asked, spp = Counter(), {}, set(), pattern.place.shape[2]
    for first in range(0, len(moving.start), BATCH):
        kept, batch = OrderedDict(), Counter()
        for p in range(first, min(first + BATCH, len(moving.start))):
            for y, x, s in np.ndindex(height, width, spp):
                depth = naive_motion.depth(moving, pattern, p, x, y, s)
                if depth is None or np.float32(depth) >= nearest.get((x, y, s), np.inf):
                    continue
                nearest[x, y, s] = np.float32(depth)
                where = at_rest(moving, pattern, p, x, y, s) if decoupled else (x + 0.5, y + 0.5)
                cell = (p, *(floor(c * rate) for c in where))
                asked.add(cell)
                batch["VISIBLE"] += 1
                batch["HITS" if cell in kept else "SHADES"] += 1
                kept[cell] = None
                kept.move_to_end(cell)
                if len(kept) > cache:
                    kept.popitem(last=False)
        batch += Counter(BATCHES=1, KEY_WARPS=-(-batch["VISIBLE"] // 32), SHADE_WARPS=-(-batch["SHADES"] // 32))
        tally += batch
    return tally, asked


def at_rest(moving, pattern, p, x, y, s):
    """Where the polygon's point at a sample lies as the shutter opens: by areas of the triangle that covers it."""
    i, j = y % len(pattern.place), x % len(pattern.place)
    at = [c * SUB + int(d) for c, d in zip((x, y), pattern.place[i, j, s], strict=True)]
    corners = naive_ste.snapped(naive_motion.placed(moving, p, pattern.time_lens[i, j, s]))
    for k in range(1, len(corners) - 1):
        chosen = [corners[0], corners[k], corners[k + 1]]
        if naive_ste.triangle_at(*chosen, *at) is None:
            continue
        rest = [moving.start[p][n][:2].astype(float) for n in (0, k, k + 1)]
        weights = [_area(at, chosen[(n + 1) % 3], chosen[(n + 2) % 3]) for n in range(3)]
        return sum(w * corner for w, corner in zip(weights, rest, strict=True)) / sum(weights)
    raise AssertionError("not covered")


def _area(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
