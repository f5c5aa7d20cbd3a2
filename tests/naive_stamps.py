"""Slow, obvious counts of stamps and of the bit mask: every event of a launch, by name."""

from collections import Counter

import numpy as np

from tests import naive_ste
from tests.naive_ste import SUB
from tests.naive_warps import WARP, Tally, address_of, groups, polygon_loads


def stamps(polygons, width, height, offsets, shape, simt):
    """Every event of stamps: ``shape`` is (width, height, whether only those that the polygon reaches, coarse side)."""
    tally = Tally()
    for first in range(0, len(polygons), 256):
        tally += polygon_loads(first, len(polygons[first : first + 256]), len(polygons[0]), simt)
    for polygon in polygons:
        tally["POLYGONS"] += 1
        side = shape[3]
        if not side:
            looked = naive_ste.box_stamps(polygon, width, height, *shape[:2])
            _stamps_in(tally, polygon, looked, (width, height), offsets, shape, simt)
            continue
        coarse = naive_ste.box_stamps(polygon, width, height, side, side)
        tally += Counter(COARSE_STAMPS=len(coarse), COARSE_WARPS=-(-len(coarse) // WARP))
        for i, j in coarse:
            if _fills(polygon, i * side, j * side, side):
                pixels = [(x, y) for y in range(j * side, (j + 1) * side) for x in range(i * side, (i + 1) * side)]
                filled = [(x, y, s) for x, y in pixels if x < width and y < height for s in range(len(offsets))]
                for warp in groups(filled, WARP):
                    tally += Counter(FILLED_SAMPLES=len(warp), FILLED_WARPS=1, HIT_WARPS=1)
                    tally.atomic([address_of(sample, width, len(offsets)) for sample in warp], simt)
            elif naive_ste.reaches(polygon, i, j, side, side):
                every = naive_ste.box_stamps(polygon, width, height, *shape[:2])
                mine = [(x, y) for x, y in every if x * shape[0] // side == i and y * shape[1] // side == j]
                _stamps_in(tally, polygon, mine, (width, height), offsets, shape, simt)
    return tally


def _fills(polygon, left, top, side):
    """Whether one triangle of a polygon covers the corners of a square, and so all of it."""
    corners, ends = naive_ste.snapped(polygon), [(0, 0), (0, 1), (1, 0), (1, 1)]
    places = [((left + i * side) * SUB - i, (top + j * side) * SUB - j) for i, j in ends]
    return any(
        all(naive_ste.triangle_at(corners[0], corners[k], corners[k + 1], *place) is not None for place in places)
        for k in range(1, len(corners) - 1)
    )


def _stamps_in(tally, polygon, looked, size, offsets, shape, simt):
    """Test the stamps among those looked at: whole stamps to a warp where they fit, else 32 samples."""
    tally += Counter(BOX_STAMPS=len(looked), BOX_WARPS=-(-len(looked) // WARP))
    warps, wide, high = [[]], *shape[:2]
    for i, j in looked:
        if shape[2] and not naive_ste.reaches(polygon, i, j, wide, high):
            continue
        pixels = [(x, y) for y in range(j * high, (j + 1) * high) for x in range(i * wide, (i + 1) * wide)]
        samples = [(x, y, s) for x, y in pixels for s in range(len(offsets))]
        tally += Counter(STAMPS=1, SAMPLE_TESTS=len(samples))
        if len(warps[-1]) + len(samples) > WARP:
            warps.append([])
        for sample in samples:
            if len(warps[-1]) == WARP:
                warps.append([])
            warps[-1].append(sample)
    for warp in warps:
        hit = [
            address_of((x, y, s), size[0], len(offsets))
            for x, y, s in warp
            if x < size[0]
            and y < size[1]
            and naive_ste.cover(polygon, x * SUB + offsets[s][0], y * SUB + offsets[s][1]) is not None
        ]
        tally["TEST_WARPS"] += bool(warp)
        if hit:
            tally += Counter(SAMPLE_HITS=len(hit), HIT_WARPS=1)
            tally.atomic(hit, simt)


def bit_mask(polygons, patches, width, height, offsets, kind, in_flight, simt):
    """Every event of a mask a patch, kept as a dictionary: (layer, row, column of samples) -> nearest depth."""
    tally, first = Tally(), 0
    while first < len(polygons):
        last = next((p for p in range(first, len(polygons)) if patches[p] != patches[first]), len(polygons))
        tally += polygon_loads(first, last - first, len(polygons[0]), simt)
        boxes = [naive_ste.box_stamps(polygon, width, height, 1, 1) for polygon in polygons[first:last]]
        pixels = [pixel for box in boxes for pixel in box]
        for group in groups(list(range(first, last)), in_flight):
            tally += Counter(SETUP_WARPS=1, POLYGONS=len(group))
        if pixels:
            low, high = map(min, zip(*pixels, strict=True)), map(max, zip(*pixels, strict=True))
            (left, top), (right, bottom) = low, high
            words = -(-(right - left + 1) * len(offsets) // 32)
            size = words * (bottom - top + 1) * (2 if kind == "facing" else 1)
            tally["CLEAR_WARPS"] += -(-size // WARP)
            mask = {}
            for group in groups(list(range(first, last)), in_flight):
                lanes = [_Lane(polygons[p], boxes[p - first], left, top, len(offsets), kind) for p in group]
                while _masked_step(
                    tally, lanes, mask, (left, top, words, bottom - top + 1), size <= 512, width, offsets, simt
                ):
                    pass
        first = last
    return tally


class _Lane:
    """One polygon's walk over the words of its rows; ``depth`` is its nearest corner."""

    def __init__(self, polygon, box, left, top, spp, kind):
        corners = naive_ste.snapped(polygon)
        area = sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
        self.polygon, self.kind = polygon, kind
        self.layer = int(kind == "facing" and area < 0)
        self.front = min(np.float32(corner[2]) for corner in polygon)
        rows = sorted({y for _, y in box})
        first, last = (
            ((min(x for x, _ in box) - left) * spp, (max(x for x, _ in box) - left + 1) * spp - 1) if box else (0, -1)
        )
        spans = [range(max(first, 32 * w), min(last, 32 * w + 31) + 1) for w in range(first // 32, last // 32 + 1)]
        self.words = [(y - top, span) for y in rows for span in spans]
        self.pending, self.active = [], bool(box)


def _masked_step(tally, lanes, mask, place, shared, width, offsets, simt):
    """Every lane reads words up to one with a sample to test, and tests it; whether any did."""
    left, top, words, height = place
    spp, most, tests, hits = len(offsets), 0, 0, []
    for lane in lanes:
        reads = 0
        while lane.active and not lane.pending and lane.words:
            reads, (row, span) = reads + 1, lane.words.pop(0)
            for column in span:
                before = mask.get((lane.layer, row, column))
                if before is None:
                    lane.pending.append((row, column))
                elif lane.kind == "depth":
                    tally["DEPTH_READS"] += 1
                    if before > lane.front or (before == lane.front and len(lanes) > 1):
                        lane.pending.append((row, column))
        tally["MASK_READS"] += reads
        most = max(most, reads)
        if not lane.pending:
            lane.active = False
            continue
        tests, (row, column) = tests + 1, lane.pending.pop(0)
        x, y, s = left + column // spp, top + row, column % spp
        depth = naive_ste.cover(lane.polygon, x * SUB + offsets[s][0], y * SUB + offsets[s][1])
        if depth is not None:
            hits.append((lane.layer, row, column, np.float32(depth), address_of((x, y, s), width, spp)))
            if lane.kind == "depth" and (lane.layer, row, column) in mask:
                mask[lane.layer, row, column] = min(mask[lane.layer, row, column], np.float32(depth))
    tally["MASK_READ_WARPS" if shared else "GLOBAL_READ_WARPS"] += most
    if tests:
        tally += Counter(TEST_WARPS=1, SAMPLE_TESTS=tests)
    if hits:
        tally += Counter(SAMPLE_HITS=len(hits), HIT_WARPS=1, MASK_WRITES=len(hits))
        tally.atomic([hit[4] for hit in hits], simt)
        written = [4 * ((layer * height + row) * words + column // 32) for layer, row, column, _, _ in hits]
        crowds = Counter(written)
        tally["MASK_WRITE_CONFLICTS"] += len(written) - len(crowds)
        if shared:
            tally += Counter(MASK_WRITE_WARPS=1, BANK_REPLAYS=max(crowds.values()) - 1)
        else:
            tally["GLOBAL_WRITE_WARPS"] += 1
        for layer, row, column, depth, _ in hits:
            mask[layer, row, column] = min(mask.get((layer, row, column), depth), depth)
    return tests > 0
