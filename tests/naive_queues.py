"""Slow, obvious counts of bin raster: every event of a launch, by name.

A round is a list of entries, a warp a list of (slot, corners, box); what is counted follows from sections 4 and 5 of
Laine & Karras 2011, with the geometry of ``naive_bins``.
"""

from collections import Counter
from dataclasses import dataclass, field

from tests.naive_bins import box_of, corners_of, slot_of, squares
from tests.naive_warps import WARP, Tally, groups
from tilestamp.models.coalescing import smallest_transaction_bytes

BLOCK = 512
SEGMENT = 512  # entries of a bin's segment


def up(count, size):
    return -(-count // size)


def area(box):
    (x0, x1), (y0, y1) = box
    return (x1 - x0 + 1) * (y1 - y0 + 1)


def wide(box):
    """The longer side of a box, in squares."""
    return max(hi - lo + 1 for lo, hi in box)


def reads_of(setup, first, end):
    """Play the ring of one batch: lists of ("read", first triangle, last tried, taken) and ("round", entries)."""
    at, waiting, steps = first, [], []
    while True:
        while len(waiting) < BLOCK and at < end:
            start, room, last = at, len(waiting), min(at + BLOCK, end)
            while at < last and room + int(setup.subtriangles[at]) <= 2048:
                n = int(setup.subtriangles[at])
                waiting += [at * 8 + 7] if n == 1 else [at * 8 + k for k in range(n)]
                room, at = room + n, at + 1
            steps.append(("read", start, last, at))
        steps.append(("round", waiting[:BLOCK]))
        waiting = waiting[BLOCK:]
        if not waiting and at >= end:
            return steps


def votes(warp, columns, walked):
    """Shared ORs of a warp, one a step in which a lane votes, and the lanes beyond the first on a bank of each."""
    steps = {}
    for at, places in warp:
        for step, (x, y) in zip(at, places, strict=True):
            steps.setdefault(step, Counter())[(x + y * columns) % WARP] += 1
    return len(steps), sum(max(banks.values()) - 1 for banks in steps.values()) if walked or steps else 0


def small_steps(corners, box, origin, side):
    """Squares of a box of at most 2 x 2, each at the step of its corner."""
    places = list(squares(corners, box, origin, side, tested=False))
    return [(x - box[0][0]) + 2 * (y - box[1][0]) for x, y in places], places


def walk_steps(corners, box, origin, side):
    """Squares of a box that the triangle touches, each at its step of the walk."""
    every = list(squares(corners, box, origin, side, tested=False))
    places = list(squares(corners, box, origin, side, tested=True))
    return [every.index(place) for place in places], places


def sectors(words, size):
    """Memory segments of ``size`` bytes that hold these words of 4 bytes."""
    return len({4 * word // size for word in words})


def bin_counts(setup, width, height, simt):
    """Every event of bin raster."""
    columns, rows = up(width, 128), up(height, 128)
    bins, triangles = columns * rows, len(setup.subtriangles)
    batch = min(max(triangles // (BLOCK * 32), 1), 32) * BLOCK
    blocks = 16
    size = smallest_transaction_bytes(int(simt.coalescing))
    tally = Tally(CTA_STARTS=blocks, CTA_BIN_WARPS=blocks * up(bins, WARP), ATOMIC=blocks)  # the last, empty draws
    for _ in range(blocks * 16):  # each warp reads the number of triangles
        tally.load([0], 4, simt)
    tally["LOAD"] += blocks * 16
    stores = blocks * 2 * sectors(range(0, bins * blocks, blocks), size)  # first segments and totals: [bin][block]
    for first in range(0, triangles, batch):
        tally += Counter(BATCHES=1, ATOMIC=1)
        state = BinState()
        for kind, *step in reads_of(setup, first, min(first + batch, triangles)):
            if kind == "read":
                tally += _bin_read(setup, *step, simt)
            else:
                stores += _bin_stores(setup, step[0], state.filled, (width, height, columns, rows), size)
                round_tally, fresh = _bin_round(setup, step[0], state.filled, (width, height, columns, rows), simt)
                tally += round_tally
                stores += _link_stores(fresh, state, size)
        filled = state.filled
        tally["CLOSED_SEGMENTS"] += len(filled)
        closing = [[state.segment[b] for b in warp if filled[b] % SEGMENT] for warp in groups(range(bins), WARP)]
        tally["CLOSING_WARPS"] += sum(map(bool, closing))
        stores += sum(sectors(warp, size) for warp in closing)
    for name in ("ATOMIC_LANES", "ATOMIC_REQUESTS", "ATOMIC_DEPTH"):
        tally[name] = tally["ATOMIC"]  # one thread each
    return tally + Counter(STORE_TRANSACTIONS=stores, STORE_BYTES=stores * size)


@dataclass
class BinState:
    """A batch so far."""

    filled: Counter = field(default_factory=Counter)  # entries of each bin
    segment: dict = field(default_factory=dict)  # the number of each bin's last segment
    allocated: int = 0


def _bin_stores(setup, entries, filled, frame, size):
    """Segments of memory that the warps' instructions write: entries of a bin lie side by side, in input order."""
    width, height, columns, rows = frame
    at, stores = Counter(filled), 0
    for warp in groups(entries, WARP):
        corners = [corners_of(slot_of(e, setup), setup, width, height) for e in warp]
        boxes = [box_of(c, (0, 0), 2048, (columns - 1, rows - 1)) for c in corners]
        slow = max(map(wide, boxes)) > 2
        written = set()
        for c, box in zip(corners, boxes, strict=True):
            every = list(squares(c, box, (0, 0), 2048, tested=False))
            for x, y in squares(c, box, (0, 0), 2048, slow):
                b = x + y * columns
                written.add((every.index((x, y)), b, 4 * at[b] // size))
                at[b] += 1
        stores += len(written)
    return stores


def _link_stores(fresh, state, size):
    """A new segment's link where the bin's last one ends, and link and count of its own beside its neighbours'."""
    stores = 0
    for warp in sorted({b // WARP for b in fresh}):
        new = [b for b in sorted(fresh) if b // WARP == warp]
        numbers = range(state.allocated, state.allocated + len(new))
        state.segment.update(zip(new, numbers, strict=True))
        state.allocated += len(new)
        stores += len(new) + 2 * sectors(numbers, size)
    return stores


def _bin_read(setup, start, last, end, simt):
    """One read of up to 512 counts, of which those from ``end`` on found no room."""
    tally = Tally()
    for warp in groups(range(start, last), WARP):
        tally.load(warp, 1, simt)
    counts = [int(n) for n in setup.subtriangles[start:last]]
    warps = groups(counts, WARP)
    return tally + Counter(
        READ_STEPS=1, READ_WARPS=len(warps), READ_LANES=len(counts), VISIBLE_LANES=sum(n > 0 for n in counts),
        ENTRIES=sum(counts[: end - start]), OVERFLOWS=int(end < last), LOAD=len(warps),
        VISIBLE_WARPS=sum(max(w) > 0 for w in warps), MULTI_WARPS=sum(max(w) > 1 for w in warps),
    )  # fmt: skip


def _bin_round(setup, entries, filled, frame, simt):
    """One round, and the bins that need a segment; ``filled`` has the entries of each bin so far."""
    width, height, columns, rows = frame
    bins, before = columns * rows, Counter(filled)
    warps_of_bins = up(bins, WARP)
    tally = Tally(
        ROUNDS=1, TRIANGLES=len(entries), BIN_WARPS=warps_of_bins, BIN_LANES=bins, MASK_CLEARS=16 * warps_of_bins,
        MASK_WARPS=16, MASK_LANES=16 * min(bins, WARP),
    )  # fmt: skip
    walks, slow_walks, paths = [0], [0], set()
    for warp in groups(entries, WARP):
        corners = [corners_of(slot_of(e, setup), setup, width, height) for e in warp]
        boxes = [box_of(c, (0, 0), 2048, (columns - 1, rows - 1)) for c in corners]
        longest = max(map(area, boxes))
        path = "SLOW" if max(map(wide, boxes)) > 2 else "FAST" if longest > 1 else "SINGLE"
        paths.add(path)
        walks.append(longest)
        tally.load([16 * slot_of(e, setup) for e in warp], 16, simt)
        tally += Counter({
            "ROUND_WARPS": 1, "LOAD": 1, "BOX_BINS": sum(map(area, boxes)), "WALK_STEPS": longest,
            "INDIRECT_WARPS": int(any(e & 7 != 7 for e in warp)), f"{path}_WARPS": 1, f"{path}_LANES": len(warp),
        })  # fmt: skip
        walk = walk_steps if path == "SLOW" else small_steps
        lanes = [walk(c, box, (0, 0), 2048) for c, box in zip(corners, boxes, strict=True)]
        ors, replays = (0, 0) if path == "SINGLE" else votes(lanes, columns, walked=True)
        tally += Counter(SHARED_ATOMIC=ors, BANK_REPLAYS=replays, ENQUEUE_STEPS=ors if path == "SLOW" else longest)
        if path == "SINGLE":
            tally["SINGLE_LOOPS"] += len({(box[0][0], box[1][0]) for box in boxes})
        if path == "SLOW":
            slow_walks.append(longest)
            tally += Counter(SLOW_STEPS=longest, SLOW_LANE_STEPS=sum(map(area, boxes)))
            ends = {row * (x1 - x0 + 1) - 1 for (x0, x1), (y0, y1) in boxes for row in range(1, y1 - y0 + 2)}
            tally["ROW_ENDS"] += len(ends)
        for _, places in lanes:
            tally["EMITS"] += len(places)
            filled.update(x + y * columns for x, y in places)
    fresh = [b for b in filled if up(filled[b], SEGMENT) > up(before[b], SEGMENT)]
    alloc_warps = len({b // WARP for b in fresh})
    return tally + Counter(
        {f"{path}_ROUNDS": 1 for path in paths}, LONGEST_WALKS=max(walks), LONGEST_SLOW=max(slow_walks),
        SEGMENTS=len(fresh), ALLOC_WARPS=alloc_warps, SHARED_ATOMIC=alloc_warps, ALLOC_ROUNDS=int(bool(fresh)),
        ATOMIC=int(bool(fresh)),
    ), fresh  # fmt: skip
