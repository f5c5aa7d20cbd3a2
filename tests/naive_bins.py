"""Slow, obvious bin and coarse raster and FreePipe, in Python integers: the oracles of their tests."""

from typing import NamedTuple

import numpy as np


class FakeSetup(NamedTuple):
    """What bin and coarse raster need of triangle setup."""

    subtriangles: np.ndarray
    headers: np.ndarray
    misc: np.ndarray


def random_setup(rng, triangles, width, height, *, size, several=0.0):
    """Counter-clockwise triangles of about ``size`` pixels; a share ``several`` of them has 2 to 7 sub-triangles."""
    counts = rng.choice([0, 1], triangles, p=[0.2, 0.8])
    split = rng.random(triangles) < several
    counts[split] = rng.integers(2, 8, split.sum())
    slots = triangles + int(counts[counts >= 2].sum())
    low, high = np.array([-8 * width, -8 * height]), np.array([8 * width, 8 * height])
    middle = rng.integers(low, high + 1, (slots, 1, 2))
    corners = np.clip(middle + rng.integers(-8 * size, 8 * size + 1, (slots, 3, 2)), low, high)
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    corners[ax * by - ay * bx < 0] = corners[ax * by - ay * bx < 0][:, [0, 2, 1]]
    misc = np.zeros(slots, np.uint32)
    several_at = np.flatnonzero(counts >= 2)
    misc[several_at] = triangles + np.concatenate([[0], np.cumsum(counts[several_at])[:-1]]).astype(int)
    return FakeSetup(counts.astype(np.uint8), corners.reshape(-1, 6).astype(np.int16), misc)


def slot_of(entry, setup):
    return entry >> 3 if entry & 7 == 7 else int(setup.misc[entry >> 3]) + (entry & 7)


def corners_of(slot, setup, width, height):
    h = [int(c) for c in setup.headers[slot]]
    return [(h[2 * k] + 8 * width, h[2 * k + 1] + 8 * height) for k in range(3)]


def box_of(corners, origin, side, last):
    """First and last column and row of squares, clamped to 0..last."""
    return [
        [min(max((pick(c[i] for c in corners) - origin[i]) // side, 0), last[i]) for pick in (min, max)] for i in (0, 1)
    ]


def touches(corners, x, y, side):
    """No edge has all four corners of the square on its outer side."""
    for k in range(3):
        (px, py), (qx, qy) = corners[k], corners[(k + 1) % 3]
        dx, dy = qx - px, qy - py
        if all((px - cx) * dy - (py - cy) * dx < 0 for cx in (x, x + side) for cy in (y, y + side)):
            return False
    return True


def squares(corners, box, origin, side, tested):
    """Squares of a box, row by row; only those that the triangle touches where ``tested``."""
    (x0, x1), (y0, y1) = box
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            if not tested or touches(corners, origin[0] + x * side, origin[1] + y * side, side):
                yield x, y


def rounds_of(setup):
    """Take rounds of up to 512 queue entries, batch by batch, and count the ring's overflows."""
    triangles = len(setup.subtriangles)
    batch = min(max(triangles // 16384, 1), 32) * 512
    rounds, overflows = [], 0
    for first in range(0, triangles, batch):
        at, end, waiting = first, min(first + batch, triangles), []
        while True:
            while len(waiting) < 512 and at < end:
                for _ in range(min(512, end - at)):
                    n = int(setup.subtriangles[at])
                    if len(waiting) + n > 2048:
                        overflows += 1
                        break
                    waiting += [at * 8 + 7] if n == 1 else [at * 8 + k for k in range(n)]
                    at += 1
            rounds.append((first // batch, waiting[:512]))
            waiting = waiting[512:]
            if not waiting and at >= end:
                break
    return rounds, overflows


def bin_queues(setup, width, height):
    """Entries of every bin, bin by bin."""
    columns, rows = -(-width // 128), -(-height // 128)
    queues = [[] for _ in range(columns * rows)]
    for _, entries in rounds_of(setup)[0]:
        for w in range(0, len(entries), 32):
            warp = [(e, corners_of(slot_of(e, setup), setup, width, height)) for e in entries[w : w + 32]]
            boxes = [box_of(c, (0, 0), 2048, (columns - 1, rows - 1)) for _, c in warp]
            slow = any(hi - lo > 1 for box in boxes for lo, hi in box)
            for (entry, corners), box in zip(warp, boxes, strict=True):
                for x, y in squares(corners, box, (0, 0), 2048, slow):
                    queues[x + y * columns].append(entry)
    return queues


def tile_queues(setup, width, height):
    """Slots of every tile, tile by tile."""
    columns, rows, bins = -(-width // 8), -(-height // 8), -(-width // 128)
    queues = [[] for _ in range(columns * rows)]
    for b, entries in enumerate(bin_queues(setup, width, height)):
        bx, by = b % bins, b // bins
        origin, last = (bx * 2048, by * 2048), (min(columns - 16 * bx, 16) - 1, min(rows - 16 * by, 16) - 1)
        for w in range(0, len(entries), 32):  # every round but the last is full, so warps never straddle rounds
            warp = [(slot_of(e, setup), None) for e in entries[w : w + 32]]
            warp = [(slot, corners_of(slot, setup, width, height)) for slot, _ in warp]
            boxes = [box_of(c, origin, 128, last) for _, c in warp]
            tested = any(hi - lo > 1 for box in boxes for lo, hi in box)
            for (slot, corners), box in zip(warp, boxes, strict=True):
                for x, y in squares(corners, box, origin, 128, tested):
                    queues[16 * bx + x + (16 * by + y) * columns].append(slot)
    return queues


def covers(corners, x, y, bits):
    """Whether the centre of pixel (x, y) belongs to a counter-clockwise triangle in sub-pixels."""
    cx, cy = (2 * x + 1) << (bits - 1), (2 * y + 1) << (bits - 1)
    for k in range(3):
        (px, py), (qx, qy) = corners[k], corners[(k + 1) % 3]
        dx, dy = qx - px, qy - py
        e = dx * (cy - py) - dy * (cx - px)
        if e < 0 or (e == 0 and not (dy < 0 or (dy == 0 and dx > 0))):
            return False
    return True
