"""Slow, obvious quad merging: a list of waiting quads, each a dictionary of its samples."""

from collections import Counter

import numpy as np

from tests import naive_ste
from tests.naive_ste import SUB

BATCH, MEMBERS = 1024, 64


def quad_shading(polygons, width, height, offsets, entries, shared):
    """Events by name, and the polygon whose colour each sample (x, y, s) has."""
    tally, seen, nearest = Counter(), {}, {}
    for first in range(0, len(polygons), BATCH):
        waiting, owner, shaded = [], {}, 0

        for p in range(first, min(first + BATCH, len(polygons))):
            for place, samples in _visible_quads(polygons[p], p, width, height, offsets, nearest).items():
                tally += Counter(QUADS=1, SAMPLE_HITS=len(samples), COMPARE_LANES=len(waiting) if entries else 0)
                entry = _joined(waiting, place, samples, p, polygons, shared) if entries else None
                tally["MERGED_QUADS"] += entry is not None
                if entry is None:
                    if len(waiting) == max(entries, 1):
                        tally["HELPERS"] += _shade(waiting.pop(0), owner, seen)
                        shaded += 1
                    entry = {"place": place, "samples": set(), "members": [], "seen": {}}
                    waiting.append(entry)
                _add(entry, p, polygons[p], samples)
                owner.update(dict.fromkeys(samples, entry))
        for entry in waiting:
            tally["HELPERS"] += _shade(entry, owner, seen)
        shaded += len(waiting)
        tally += Counter(SHADED_QUADS=shaded, SHADE_LANES=4 * shaded, SHADE_WARPS=-(-shaded // 8), BATCHES=1)
    return tally, seen


def _shade(entry, owner, seen):
    """Colour the samples that are still an entry's; returns its pixels without a sample."""
    for sample in entry["samples"]:
        if owner[sample] is entry:
            seen[sample] = entry["seen"][sample[:2]]
    return 4 - len(entry["seen"])


def _visible_quads(polygon, p, width, height, offsets, nearest):
    """Samples of a polygon that are nearer than all before, by quad, row by row."""
    found = {}
    for y in range(height):
        for x in range(width):
            for s, (right, down) in enumerate(offsets):
                depth = naive_ste.cover(polygon, x * SUB + right, y * SUB + down)
                if depth is None:
                    continue
                depth = np.float32(depth)
                if (x, y, s) not in nearest or depth < nearest[x, y, s]:
                    nearest[x, y, s] = depth
                    found.setdefault((y // 2, x // 2), set()).add((x, y, s))
    return dict(sorted(found.items()))


def _joined(waiting, place, samples, p, polygons, shared):
    """The newest entry at the place that a quad can join."""
    for entry in reversed(waiting):
        if entry["place"] != place:
            continue
        if entry["samples"] & samples:
            return None
        alike = _faces(polygons[entry["members"][0]]) == _faces(polygons[p])
        near = any(_in_common(polygons[m], polygons[p]) >= shared for m in entry["members"])
        if alike and near and len(entry["members"]) < MEMBERS:
            return entry
    return None


def _faces(polygon):
    corners = naive_ste.snapped(polygon)
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)) > 0


def _in_common(one, other):
    return sum(a == b for a in one for b in other)


def _add(entry, p, polygon, samples):
    """Polygons over a pixel's centre are shaded there, else the first that covers a sample of it."""
    entry["samples"] |= samples
    entry["members"].append(p)
    for x, y in {sample[:2] for sample in samples}:
        centre = naive_ste.cover(polygon, x * SUB + SUB // 2, y * SUB + SUB // 2) is not None
        if centre or (x, y) not in entry["seen"]:
            entry["seen"][x, y] = p
