"""Slow, obvious counts of coarse raster: every event of a launch but its stores, by name (see ``naive_queues``)."""

from collections import Counter

from tests.naive_bins import box_of, corners_of, slot_of
from tests.naive_queues import BLOCK, SEGMENT, area, sectors, small_steps, up, votes, walk_steps, wide
from tests.naive_warps import WARP, Tally, groups
from tilestamp.models.coalescing import smallest_transaction_bytes

TILE_SEGMENT = 32


def coarse_counts(setup, batch_counts, queues, width, height, simt):
    """Every event of coarse raster but its stores, with a clear pending; ``queues`` are the bins' entries."""
    sms, size = simt.sms, smallest_transaction_bytes(int(simt.coalescing))
    columns, rows, bins_x = up(width, 8), up(height, 8), up(width, 128)
    bins = len(queues)
    merges = max(0, (up(bins, 16) - 1).bit_length())
    sort = Counter(
        CTA_STARTS=1, ATOMIC=1, BIN_WARPS=up(bins, WARP), SORT_WARPS=up(max(bins // 2, 1), WARP), SORT_MERGES=merges,
        SORT_STEPS=up(bins, WARP) * sum(4 + turn for turn in range(merges)), LOAD=2 * 16 + 16 * up(bins, WARP),
    )  # fmt: skip
    of_warps = groups([16 * b for b in range(bins)], WARP)  # totals: [bin][stream], one stream after the other
    sort["LOAD_TRANSACTIONS"] = 32 + sum(sectors([w + k for w in warp], size) for warp in of_warps for k in range(16))
    sort["LOAD_BYTES"] = size * sort["LOAD_TRANSACTIONS"]
    tally = Tally({name: sms * count for name, count in sort.items()})
    for b, entries in enumerate(queues):
        bx, by = b % bins_x, b // bins_x
        last = (min(columns - 16 * bx, 16) - 1, min(rows - 16 * by, 16) - 1)
        in_frame = [x + 16 * y for y in range(last[1] + 1) for x in range(last[0] + 1)]
        tally += Counter(
            BINS=1, TRIANGLES=len(entries), ATOMIC=2, ACTIVE_TILES=len(in_frame),
            ACTIVE_WARPS=len({tile // WARP for tile in in_frame}),
        )  # fmt: skip
        tally += _merges([int(n) for n in batch_counts[:, b]], size)
        filled = Counter()
        for of_round in groups(entries, BLOCK):
            tally += _coarse_round(setup, of_round, filled, (bx * 2048, by * 2048), last, (width, height), simt)
    for name in ("ATOMIC_LANES", "ATOMIC_REQUESTS", "ATOMIC_DEPTH"):
        tally[name] = tally["ATOMIC"]
    return tally


def _merges(batches, sector):
    """Merge a bin's segments, batch by batch, until more than 512 entries wait; the last merge finds none."""
    segments = [min(SEGMENT, n - at) for n in batches for at in range(0, n, SEGMENT)]
    tally, waiting, left = Counter(), 0, sum(batches)
    while left:
        while waiting <= BLOCK:
            tally["MERGES"] += 1
            if not segments:
                break
            size = segments.pop(0)
            moved = 2 + up(4 * size, sector)  # its count, the link to the next, and its entries
            tally += Counter(STREAM_READS=1, MERGE_WARPS=up(size, WARP), LOAD=2 + up(size, WARP))
            tally += Counter(LOAD_TRANSACTIONS=moved, LOAD_BYTES=moved * sector)
            waiting += size
        taken = min(BLOCK, waiting)
        waiting, left = waiting - taken, left - taken
    return tally


def _coarse_round(setup, entries, filled, origin, last, size, simt):
    """One round of a bin; ``filled`` has the entries of each of its tiles so far."""
    before = Counter(filled)
    tally = Tally(ROUNDS=1)
    longest = {"B": 0, "C": 0}
    cases = set()
    for warp in groups(entries, WARP):
        corners = [corners_of(slot_of(e, setup), setup, *size) for e in warp]
        boxes = [box_of(c, origin, 128, last) for c in corners]
        tally.load([16 * slot_of(e, setup) for e in warp], 16, simt)
        union = [[min(b[i][0] for b in boxes), max(b[i][1] for b in boxes)] for i in (0, 1)]
        most, every, height = max(map(area, boxes)), area(union), union[1][1] - union[1][0] + 1
        case = "A" if max(map(wide, boxes)) <= 2 else "B" if 4 * every <= 8 * most else "C"
        cases.add(case)
        tally += Counter({
            "ROUND_WARPS": 1, "LOAD": 1, "BOX_TILES": sum(map(area, boxes)), f"CASE_{case}_WARPS": 1,
            "INDIRECT_WARPS": int(any(e & 7 != 7 for e in warp)),
        })  # fmt: skip
        walk = small_steps if case == "A" else walk_steps
        lanes = [walk(c, box, origin, 128) for c, box in zip(corners, boxes, strict=True)]
        if case == "B":  # votes, no shared OR
            longest["B"] = max(longest["B"], every)
            tally += Counter(
                CASE_B_STEPS=every, CASE_B_ROWS=height, CASE_B_LANE_STEPS=sum(map(area, boxes)),
                CASE_B_LANE_ROWS=height * len(warp),
            )  # fmt: skip
        else:
            ors, replays = votes(lanes, 16, walked=True)
            tally += Counter(SHARED_ATOMIC=ors, BANK_REPLAYS=replays)
        if case == "C":
            longest["C"] = max(longest["C"], most)
            tally += Counter(CASE_C_STEPS=most, CASE_C_LANE_STEPS=sum(map(area, boxes)))
        for _, places in lanes:
            filled.update(x + 16 * y for x, y in places)
    emitted = {tile: filled[tile] - before[tile] for tile in filled if filled[tile] > before[tile]}
    emits = sum(emitted.values())
    fresh = {t: n for t in emitted if (n := up(filled[t], TILE_SEGMENT) - up(before[t], TILE_SEGMENT)) > 0}
    return tally + Counter(
        LONGEST_B=longest["B"], LONGEST_C=longest["C"], CASE_A_ROUNDS=int("A" in cases),
        WIDE_ROUNDS=int(bool(cases - {"A"})), TILES_TOUCHED=len(emitted), EMITS=emits, EMIT_STEPS=up(emits, BLOCK),
        EMIT_WARPS=up(emits, WARP), EMIT_BLOCK_WARPS=min(up(emits, WARP), 16), SEGMENTS=sum(fresh.values()),
        SEGMENT_WARPS=up(sum(fresh.values()), WARP), ALLOC_ROUNDS=int(bool(fresh)), ATOMIC=int(bool(fresh)),
        LINK_WARPS=len({t // WARP for t in fresh}), FIRST_WARPS=len({t // WARP for t in fresh if not before[t]}),
        SCAN_WARPS=len({t // WARP for t, n in emitted.items() if n > 1}),
    )  # fmt: skip
