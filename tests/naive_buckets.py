"""Slow, obvious counts of the micropolygon front end and of bucketing: every event of a launch, by name.

A thread has one sub-patch or patch; what a warp does is what its lanes want, and memory is asked of ``models``.
"""

from collections import Counter

from tests.naive_tiles import naive_conflicts, naive_ranges
from tests.naive_warps import Tally, groups


def store(tally, addresses, size, simt):
    """One store instruction; a negative address is an idle lane."""
    asked = Tally()
    asked.load(addresses, size, simt)
    tally["STORE_TRANSACTIONS"] += asked["LOAD_TRANSACTIONS"]
    tally["STORE_BYTES"] += asked["LOAD_BYTES"]


def transform(points, simt):
    """A thread a control point of 16 bytes."""
    tally = Tally(POINT_LANES=points)
    for warp in groups(range(points), simt.warp):
        tally["POINT_WARPS"] += 1
        tally.load([16 * p for p in warp], 16, simt)
        store(tally, [16 * p for p in warp], 16, simt)
    return tally


def oracle(patch, path, simt):
    """A thread a sub-patch: culled (0), kept (1), given up (2), across the eye (3) or split (4)."""
    tally = Tally(
        EXAMINE_LANES=len(path), CULLED=path.count(0), KEPT=path.count(1), GIVEN_UP=path.count(2),
        SPLIT=path.count(3) + path.count(4), BOX_LANES=path.count(1) + path.count(4),
    )  # fmt: skip
    for warp in groups(range(len(path)), simt.warp):
        boxes = sum(path[i] in {1, 4} for i in warp)
        tally += Counter(EXAMINE_WARPS=1, BOX_WARPS=int(boxes > 0), DIVERGENT_WARPS=int(0 < boxes < len(warp)))
        for point in range(16):
            tally.load([256 * patch[i] + 16 * point for i in warp], 16, simt)
        tally.load([8 * i for i in warp], 8, simt)
        store(tally, [4 * i for i in warp], 4, simt)
    return tally


def subdivide(path, places, simt):
    """A thread a sub-patch: kept ones move, split ones leave four children, one store after the other."""
    tally = Tally(MOVE_LANES=len(path), KEEP_LANES=path.count(1), SPLIT_LANES=path.count(3) + path.count(4))
    for warp in groups(range(len(path)), simt.warp):
        kept, split = [path[i] == 1 for i in warp], [path[i] in {3, 4} for i in warp]
        tally += Counter(MOVE_WARPS=1, KEEP_WARPS=int(any(kept)), SPLIT_WARPS=int(any(split)))
        tally["DIVERGENT_WARPS"] += any(any(way) and not all(way) for way in (kept, split))
        for size in (8, 4, 4):  # its entry, its wish and its place
            tally.load([size * i for i in warp], size, simt)
        for active, child in [(kept, 0), *((split, child) for child in range(4))]:
            if any(active):
                addresses = [8 * (places[i] + child) if a else -1 for i, a in zip(warp, active, strict=True)]
                store(tally, addresses, 8, simt)
    return tally


def _slots(boxes, tile, columns, rows, slots):
    """Tile of each slot of each patch, -1 where it holds none."""
    found = []
    for x0, y0, x1, y1 in naive_ranges(boxes, tile, columns, rows, slots):
        places = [(x0 + slot % slots, y0 + slot // slots) for slot in range(slots**2)]
        found.append([y * columns + x if x <= x1 and y <= y1 else -1 for x, y in places])
    return found


def _idx(warp, patches, slots):
    """Addresses and size of the instructions that reach IDX: a vector of four slots, else a word a slot."""
    if slots == 2:
        return [([16 * p for p in warp], 16)]
    return [([4 * (slot * patches + p) for p in warp], 4) for slot in range(slots**2)]


def bucket_count(boxes, tile, columns, rows, slots, simt):
    """Every event of the address calculation."""
    tally = Tally(naive_conflicts(boxes, tile, columns, rows, slots, simt))
    tally["PATCH_LANES"] = len(boxes)
    for warp in groups(range(len(boxes)), simt.warp):
        tally += Counter(PATCH_WARPS=1, SLOT_WARPS=slots**2)
        tally.load([16 * p for p in warp], 16, simt)
        for addresses, size in _idx(warp, len(boxes), slots):
            store(tally, addresses, size, simt)
    return tally


def bucket_write(boxes, idx, start, tile, columns, rows, slots, simt):
    """Every event of the write of the lists."""
    tally, tiles = Tally(PATCH_LANES=len(boxes)), _slots(boxes, tile, columns, rows, slots)
    for warp in groups(range(len(boxes)), simt.warp):
        tally += Counter(PATCH_WARPS=1, SLOT_WARPS=slots**2)
        of_boxes, of_idx = Tally(), Tally()
        of_boxes.load([16 * p for p in warp], 16, simt)
        for addresses, size in _idx(warp, len(boxes), slots):
            of_idx.load(addresses, size, simt)
        tally += of_boxes + of_idx + Counter(BOX_BYTES=of_boxes["LOAD_BYTES"], IDX_BYTES=of_idx["LOAD_BYTES"])
        for slot in range(slots**2):
            wanted = [tiles[p][slot] for p in warp]
            active = sum(t >= 0 for t in wanted)
            if active:
                last = int(slot == slots**2 - 1)
                tally += Counter(
                    WRITE_WARPS=1, WRITE_LANES=active, DIVERGENT_WARPS=int(active < len(warp)),
                    LAST_WRITE_WARPS=last, LAST_WRITE_LANES=last * active,
                )  # fmt: skip
                tally.load([4 * t if t >= 0 else -1 for t in wanted], 4, simt)
                places = [4 * (start[t] + idx[p][slot]) if t >= 0 else -1 for p, t in zip(warp, wanted, strict=True)]
                store(tally, places, 4, simt)
                tally["STORE_LINES"] += len({place // 128 for place in places if place >= 0})
    return tally
