"""Slow, obvious counts of stages whose warps walk boxes in lockstep: every event of a launch, by name.

Where a lane goes follows from the papers' loops, with coverage in Python integers; what an instruction does to memory
is asked of ``tilestamp.models``, whose rules have oracles of their own.
"""

from collections import Counter, defaultdict

import numpy as np

from tests import naive_ste
from tests.naive_bins import covers
from tests.naive_ste import SUB
from tilestamp.models.atomics import count_atomics
from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.simulator.stages.liu2010.freepipe_triangle import CLIPPED, INSIDE

WARP = 32


class Tally(Counter):
    """Events by name."""

    def load(self, addresses, size, simt):
        """One load instruction; a negative address is an idle lane."""
        count, moved = transactions(np.array(addresses, np.int64), len(addresses), size, int(simt.coalescing))
        self["LOAD_TRANSACTIONS"] += count
        self["LOAD_BYTES"] += moved

    def atomic(self, addresses, simt, words=1):
        """One atomic instruction on each of ``words`` planes."""
        lanes, requests, conflicts, depth = count_atomics(
            np.array(addresses, np.int64), len(addresses), int(simt.atomic_merge)
        )
        for name, count in zip(
            ("LANES", "REQUESTS", "CONFLICTS", "DEPTH"), (lanes, requests, conflicts, depth), strict=True
        ):
            self[f"ATOMIC_{name}"] += words * count


def groups(items, size):
    """Cut a list into lists of ``size``."""
    return [items[i : i + size] for i in range(0, len(items), size)]


# FreePipe


def freepipe(triangles, pieces, width, block, unroll, simt):
    """Every event of packing "64" without early reads; ``pieces`` as ``make_pieces`` has them."""
    tally = Tally()
    for of_block in groups(list(range(len(triangles))), block):
        longest = (0, 0, 0)
        for warp in groups(of_block, WARP):
            tally += Counter(WARPS=1, LANES_IN=len(warp))
            for k in range(3):
                tally.load([12 * t + 4 * k for t in warp], 4, simt)
                tally.load([16 * triangles[t][k] for t in warp], 16, simt)
            scans = [[int(pieces.first[t]) for t in warp if pieces.kind[t] == INSIDE]]
            clipped = [list(range(pieces.first[t], pieces.first[t + 1])) for t in warp if pieces.kind[t] == CLIPPED]
            tally["CLIP_LANES"] += len(clipped)
            tally["CLIP_WARPS"] += bool(clipped)
            turns = range(max(map(len, clipped), default=0))
            scans += [[mine[turn] for mine in clipped if turn < len(mine)] for turn in turns]
            done = [
                _scan(tally, pieces, lanes, width, unroll, simt) for lanes in scans if lanes or lanes is not scans[0]
            ]
            tally["CLIP_HITS"] += sum(hits for _, _, hits in done[bool(scans[0]) :])
            chain = tuple(map(sum, zip(*done, strict=True))) if done else (0, 0, 0)
            longest = max(longest, chain, key=lambda steps_rows_hits: steps_rows_hits[0])
        for name, value in zip(("CHAIN_STEPS", "CHAIN_ROWS", "CHAIN_HITS"), longest, strict=True):
            tally[name] += value
    return tally


def _scan(tally, pieces, lanes, width, unroll, simt):
    """All rows of a warp's pieces; returns its steps, rows, and steps that hit."""
    boxes = [tuple(map(int, pieces.box[p])) for p in lanes]  # x0, x1, y0, y1
    drawn = [(p, box) for p, box in zip(lanes, boxes, strict=True) if box[1] >= box[0] and box[3] >= box[2]]
    tally += Counter(SETUP_STEPS=1, SETUP_LANES=len(lanes), BOX_LANES=len(drawn), BOX_STEPS=int(bool(drawn)))
    rows = max((box[3] - box[2] + 1 for _, box in drawn), default=0)
    steps = hit_steps = 0
    for r in range(rows):
        here = [(p, box) for p, box in drawn if box[2] + r <= box[3]]
        columns = [box[1] - box[0] + 1 for _, box in here]
        rest, turns = max(n % unroll for n in columns), max(n // unroll for n in columns)
        tally += Counter(ROW_STEPS=1, ROW_LANES=len(here), REST_STEPS=rest, WARP_STEPS=rest + unroll * turns)
        hits = defaultdict(list)
        for (p, box), n in zip(here, columns, strict=True):
            tally["SAMPLE_TESTS"] += n
            corners = [tuple(map(int, c)) for c in np.reshape(pieces.corner[p], (3, 2))]
            for i in range(n):
                step = i if i < n % unroll else rest + i - n % unroll
                if pieces.facing[p] and covers(corners, box[0] + i, box[2] + r, 4):
                    hits[step].append(8 * ((box[2] + r) * width + box[0] + i))
        for addresses in hits.values():
            tally += Counter(SAMPLE_HITS=len(addresses), ATOMIC=1)
            tally.atomic(addresses, simt)
        steps, hit_steps = steps + rest + unroll * turns, hit_steps + len(hits)
    return steps, rows, hit_steps


# micropolygons


def samples_of(polygon, width, height, offsets):
    """Samples (x, y, s) of the pixels of a polygon's box, row by row, each with whether it hits."""
    pixels = naive_ste.box_stamps(polygon, width, height, 1, 1)
    return [
        ((x, y, s), naive_ste.cover(polygon, x * SUB + dx, y * SUB + dy) is not None)
        for x, y in pixels
        for s, (dx, dy) in enumerate(offsets)
    ]


def address_of(sample, width, spp):
    """Byte address of a sample: a word of 64 bits, depth and polygon."""
    x, y, s = sample
    return 8 * ((y * width + x) * spp + s)


def across_polygons(polygons, width, height, offsets, packing, simt):
    """Every event of one lane a polygon."""
    tally = Tally()
    spp = len(offsets)
    for first in range(0, len(polygons), 256):
        chunk = polygons[first : first + 256]
        tally += polygon_loads(first, len(chunk), len(polygons[0]), simt)
        tests = [samples_of(polygon, width, height, offsets) for polygon in chunk]
        if packing == "sorted":
            tally["SORT_WARPS"] += 36 * -(-len(chunk) // WARP)
            tests.sort(key=len)
        waiting, lanes = list(tests), [[] for _ in range(WARP)]
        while waiting or any(lanes):
            idle = sum(not lane for lane in lanes)
            if waiting and idle >= (WARP // 2 if packing == "repacked" else WARP):
                tally["SETUP_WARPS"] += 1
                for i in range(WARP):
                    if waiting and not lanes[i]:
                        tally["POLYGONS"] += 1
                        lanes[i] = list(waiting.pop(0))
            now = [lane.pop(0) for lane in lanes if lane]
            one_test(tally, now, width, spp, simt)
    return tally


def polygon_loads(first, count, corners, simt):
    """Loads of polygons side by side, 12 bytes a corner, as one range that warps read in order."""
    number, moved = contiguous(first * corners * 12, count * corners * 12, int(simt.coalescing))
    return Counter(LOAD_TRANSACTIONS=number, LOAD_BYTES=moved)


def one_test(tally, tests, width, spp, simt):
    """One warp execution of the sample test, and of depth and atomic where a lane hits."""
    if tests:
        tally += Counter(TEST_WARPS=1, SAMPLE_TESTS=len(tests))
    hits = [address_of(sample, width, spp) for sample, hit in tests if hit]
    if hits:
        tally += Counter(SAMPLE_HITS=len(hits), HIT_WARPS=1)
        tally.atomic(hits, simt)
