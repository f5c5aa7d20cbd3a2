"""Slow, obvious counts of Ru's raster kernels: every event of a launch, by name.

Coverage is decided in float64: the scenes of the tests have no sample near an edge.
"""

from collections import Counter

import numpy as np

from tests.naive_buckets import store
from tests.naive_textured import barycentric, faces_front
from tests.naive_warps import Tally, groups
from tilestamp.models.coalescing import smallest_transaction_bytes

BLOCK = 128


def weights_of(screen, triangle, x, y):
    """Barycentric coordinates of a pixel's centre where it is inside; None elsewhere."""
    found = barycentric(screen[triangle].astype(float), x + 0.5, y + 0.5)
    return found if found is not None and min(found) >= 0 else None


def depth_of(screen, triangle, weights):
    """Depth on the screen."""
    return sum(w * float(screen[v, 2]) for w, v in zip(weights, triangle, strict=True))


def by_block(warps):
    """Warps of each block."""
    return groups(warps, BLOCK // 32)


def _lanes_lost(tally, simt, lanes, words):
    """Loads of a word by each lane, a segment of its own each."""
    moved = lanes * words
    tally += Counter(LOAD_TRANSACTIONS=moved, LOAD_BYTES=moved * smallest_transaction_bytes(int(simt.coalescing)))


# one thread a triangle


def per_primitive(screen, triangles, width, height, simt, *, culling, textured):
    """Every event of the raster kernel, where all warps are resident together; ``textured``: triangles, as tuples."""
    tally = Tally()
    depth = np.full((height, width), 2**31 - 1)
    warps = [
        _Walk(screen, warp, width, height, culling) for warp in groups([tuple(map(int, t)) for t in triangles], 32)
    ]
    for turn in range(max((len(w.steps) for w in warps), default=0)):
        for warp in warps:
            if turn < len(warp.steps):
                _walk_step(tally, screen, warp, warp.steps[turn], depth, simt, textured)
    for warp in warps:
        front = warp.lanes - warp.culled
        tally += Counter(WARPS=1, WARP_LANES=warp.lanes, CULLED=warp.culled, BOX_STEPS=len(warp.steps))
        tally += Counter(FRONT_WARPS=int(front > 0), FRONT_LANES=front)
        tally += Counter(COLUMN_STEPS=sum(n > 0 for n in warp.columns), COLUMN_LANES=sum(warp.columns))
    for block in by_block(warps):
        tally["BLOCKS"] += 1
        tally["LONGEST"] += max(len(w.steps) for w in block)
        tally["LONGEST_HITS"] += max(w.hits for w in block)
        tally["LONGEST_WRITES"] += max(w.writes for w in block)
        tally["LONGEST_TEXTURED"] += max(w.textured for w in block)
        tally["LONGEST_COLUMNS"] += max(sum(n > 0 for n in w.columns) for w in block)
    _lanes_lost(tally, simt, tally["WARP_LANES"], 9)  # x, y, z of three vertices
    _lanes_lost(tally, simt, tally["ATOMIC_LANES"], 3)  # w of three vertices
    _lanes_lost(tally, simt, tally["WRITE_LANES"], 19)
    _lanes_lost(tally, simt, tally["TEXTURED_LANES"], 9)
    written = tally["WRITE_LANES"] * 7 + tally["TEXTURED_LANES"] * 5
    segment = smallest_transaction_bytes(int(simt.coalescing))
    return tally + Counter(STORE_TRANSACTIONS=written, STORE_BYTES=written * segment)


class _Walk:
    """One warp: which lanes test which pixel, step by step; a lane goes on to its next column by itself."""

    def __init__(self, screen, triangles, width, height, culling):
        self.lanes, self.hits, self.writes, self.textured = len(triangles), 0, 0, 0
        drawn = [t for t in triangles if faces_front(screen[list(t)]) or not culling]
        self.culled = self.lanes - len(drawn)
        walks, ends = [], []
        for t in drawn:
            box = []
            for axis, size in ((0, width), (1, height)):
                values = [float(screen[v, axis]) for v in t]
                box.append([int(min(max(pick(values), 0), size - 1)) for pick in (min, max)])
            (left, right), (top, bottom) = box
            walks.append([(t, x, y) for x in range(left, right + 1) for y in range(bottom, top - 1, -1)])
            ends.append(bottom - top + 1)
        longest = max(map(len, walks), default=0)
        self.steps = [[walk[n] for walk in walks if n < len(walk)] for n in range(longest)]
        self.columns = [
            sum(n < len(walk) and (n + 1) % rows == 0 for walk, rows in zip(walks, ends, strict=True))
            for n in range(longest)
        ]


def _walk_step(tally, screen, warp, tests, depth, simt, textured):
    """One step of a warp: test, atomicMin, and the fragments of those that came nearer."""
    tally["SAMPLE_TESTS"] += len(tests)
    addresses, nearer, mapped = [], 0, 0
    for t, x, y in tests:
        weights = weights_of(screen, list(t), x, y)
        z = None if weights is None else depth_of(screen, t, weights)
        if z is None or not 0 <= z < 1:
            continue
        addresses.append(4 * (y * depth.shape[1] + x))
        if int(z * (2**31 - 1)) < depth[y, x]:
            depth[y, x] = int(z * (2**31 - 1))
            nearer += 1
            mapped += t in textured
    if addresses:
        tally += Counter(SAMPLE_HITS=len(addresses), ATOMIC=1, WRITES=int(nearer > 0), WRITE_LANES=nearer)
        tally.atomic(addresses, simt)
        tally += Counter(TEXTURED_WRITES=int(mapped > 0), TEXTURED_LANES=mapped)
        warp.hits, warp.writes = warp.hits + 1, warp.writes + (nearer > 0)
        warp.textured += mapped > 0


# tile lists


def tile_lists(screen, triangles, width, height, tile, simt, edges_tried, order, *, culling, filling):
    """Every event of the counting launch, or of the filling one; and the lists. ``order``: of warps in a round."""
    across = -(-width // tile)
    lists = [[] for _ in range(across * -(-height // tile))]
    for given in (False, True):
        starts = np.concatenate([[0], np.cumsum([len(one) for one in lists])])
        lists, tally = [[] for _ in lists], Tally()
        warps = [
            _Lister(tally, screen, warp, (width, height, tile), culling)
            for warp in groups([tuple(map(int, t)) for t in triangles], 32)
        ]
        for turn in range(max(len(w.steps) for w in warps)):
            for w in (warps[n] for n in order if n < len(warps) and turn < len(warps[n].steps)):
                _list_step(tally, screen, w, turn, (across, tile), lists, starts if given else None, simt, edges_tried)
        for block in by_block(warps):
            tally["BLOCKS"] += 1
            for event, most in (
                ("LONGEST", lambda w: len(w.steps)),
                ("LONGEST_APPENDS", lambda w: w.appends),
                ("LONGEST_EDGES", lambda w: w.edges),
                ("LONGEST_ROWS", lambda w: w.rows),
            ):
                tally[event] += max(map(most, block))
        if not filling:
            break
    _lanes_lost(tally, simt, len(triangles), 6)  # x and y of three vertices
    return tally, lists


class _Lister:
    """One warp over the tiles of its boxes, row by row from below; its lanes meet again after each row."""

    def __init__(self, tally, screen, triangles, size, culling):
        width, height, tile = size
        self.appends, self.edges, boxes = 0, 0, []
        front = [t for t in triangles if faces_front(screen[list(t)]) or not culling]
        tally += Counter(WARPS=1, WARP_LANES=len(triangles), CULLED=len(triangles) - len(front))
        tally += Counter(FRONT_WARPS=int(len(front) > 0), FRONT_LANES=len(front))
        for t in front:
            xs, ys = ([float(screen[v, axis]) for v in t] for axis in (0, 1))
            if max(xs) >= 0 and max(ys) >= 0 and min(xs) <= width and min(ys) <= height:
                x = [int(max(min(xs), 0)) // tile, int(min(max(xs), width - 1)) // tile]
                y = [int(max(min(ys), 0)) // tile, int(min(max(ys), height - 1)) // tile]
                if x[0] <= x[1] and y[0] <= y[1]:
                    boxes.append((t, x, y))
        self.rows = max((y[1] - y[0] + 1 for _, _, y in boxes), default=0)
        self.steps = []
        for line in range(self.rows):
            here = [(t, x, y[1] - line) for t, x, y in boxes if y[1] - line >= y[0]]
            tally += Counter(ROW_STEPS=1, ROW_LANES=len(here), BOX_LANES=sum(x[1] - x[0] + 1 for _, x, _ in here))
            for column in range(max(x[1] - x[0] + 1 for _, x, _ in here)):
                self.steps.append([(t, x[0] + column, y) for t, x, y in here if x[0] + column <= x[1]])


def _list_step(tally, screen, warp, turn, size, lists, starts, simt, edges_tried):
    """One step of a warp: its lanes try their tiles and append."""
    across, tile = size
    counters, entries, tries = [], [], []
    for t, x, y in warp.steps[turn]:
        corners = [screen[v, axis] for v in t for axis in (0, 1)]
        tried = edges_tried(*corners, *(np.float32(n * tile) for n in (x, y)), np.float32(tile))
        tries.append(min(tried, 3))
        if tried > 3:
            target = y * across + x
            counters.append(4 * target)
            entries.append(4 * (int(starts[target]) + len(lists[target])) if starts is not None else -1)
            lists[target].append(t)
    warp.edges += max(tries)
    tally += Counter(BOX_STEPS=1, EDGE_STEPS=max(tries), EDGE_LANES=sum(tries))
    if counters:
        warp.appends += 1
        tally += Counter(APPENDS=1, APPEND_LANES=len(counters), ATOMIC=1)
        tally.atomic(counters, simt)
        store(tally, entries, 4, simt)


# one thread a pixel of a tile


def tiled_raster(screen, lists, width, height, tile, simt):
    """Every event of the raster kernel but its stores."""
    tally, across = Tally(), -(-width // tile)
    warps = -(-tile * tile // 32)
    for i, listed in enumerate(lists):
        left, top = i % across * tile, i // across * tile
        depth, most = {}, [Counter(), Counter()]
        tally += Counter(BLOCKS=1, WARPS=warps, WARP_LANES=tile * tile, ENTRIES=len(listed))
        if listed:
            tally += Counter(LISTED_WARPS=warps, LISTED_LANES=tile * tile)
        tally += Counter(TEST_WARPS=warps * len(listed), SAMPLE_TESTS=tile * tile * len(listed))
        for t in listed:
            hit, nearer = [], []
            for n in range(tile * tile):
                x, y = left + n % tile, top + n // tile
                weights = weights_of(screen, list(t), x, y) if x < width and y < height else None
                if weights is not None:
                    hit.append(n // 32)
                    z = depth_of(screen, t, weights)
                    if 0 <= z < depth.get(n, 1.0):
                        depth[n] = z
                        nearer.append(n // 32)
            tally += Counter(SAMPLE_HITS=len(hit), HIT_WARPS=len(set(hit)))
            tally += Counter(NEARER_LANES=len(nearer), NEARER_WARPS=len(set(nearer)))
            most[0].update(set(hit))
            most[1].update(set(nearer))
        tally["LONGEST_HITS"] += max(most[0].values(), default=0)
        tally["LONGEST_NEARER"] += max(most[1].values(), default=0)
    nearer = 26 if int(simt.coalescing) == 3 else 27
    reads = tally["WARPS"] + 7 * tally["TEST_WARPS"] + 6 * tally["HIT_WARPS"]  # all lanes read one word
    reads += nearer * tally["NEARER_WARPS"]
    segment = smallest_transaction_bytes(int(simt.coalescing))
    return tally + Counter(LOAD_TRANSACTIONS=reads, LOAD_BYTES=reads * segment)
