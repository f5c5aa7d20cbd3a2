"""Slow, obvious versions of bucketing and tile raster: one thread after the other, as the CUDA kernels are written."""

import numpy as np

from tilestamp.models.simt import AtomicMerge, Coalescing

F = np.float32


def naive_ranges(boxes, tile, columns, rows, slots):
    """Tile columns and rows of each box, clamped to the screen and to ``slots`` a side."""
    ranges = []
    for box in boxes:
        x0, y0, x1, y1 = (int(np.floor(float(b) / tile)) for b in box)
        x0, y0 = max(x0, 0), max(y0, 0)
        ranges.append((x0, y0, min(x1, columns - 1, x0 + slots - 1), min(y1, rows - 1, y0 + slots - 1)))
    return ranges


def naive_buckets(boxes, tile, columns, rows, slots, warp):
    """COUNT, IDX and the lists as a Python list of lists, in the order of warps, slots, lanes."""
    ranges = naive_ranges(boxes, tile, columns, rows, slots)
    lists = [[] for _ in range(columns * rows)]
    idx = [[0] * slots**2 for _ in boxes]
    for first in range(0, len(boxes), warp):
        for slot in range(slots**2):
            for p in range(first, min(first + warp, len(boxes))):
                x0, y0, x1, y1 = ranges[p]
                x, y = x0 + slot % slots, y0 + slot // slots
                if x <= x1 and y <= y1:
                    idx[p][slot] = len(lists[y * columns + x])
                    lists[y * columns + x].append(p)
    return [len(members) for members in lists], idx, lists


def naive_atomics(words, merge):
    """Lanes, requests, conflicts, depth, lock depth and sectors of one instruction on counters ``words``."""
    lanes = [words.count(word) for word in set(words)]
    sectors = {word // 8 for word in words}
    requests = len(words)
    if merge == AtomicMerge.SECTOR:
        requests = sum(max(words.count(word) for word in words if word // 8 == sector) for sector in sectors)
    lock_depth = max(sum(word // 8 == sector for word in words) for sector in sectors)
    return len(words), requests, len(words) - len(lanes), max(lanes), lock_depth, len(sectors)


def naive_conflicts(boxes, tile, columns, rows, slots, simt, padding=1, aggregate=False):
    """Give sums over all instructions: a dictionary by event name."""
    ranges = naive_ranges(boxes, tile, columns, rows, slots)
    group = 16 if simt.coalescing == Coalescing.HALF_WARP_SEGMENTS else simt.warp
    names = ("ATOMIC_LANES", "ATOMIC_REQUESTS", "ATOMIC_CONFLICTS", "ATOMIC_DEPTH", "LOCK_DEPTH", "ATOMIC_SECTORS")
    total = dict.fromkeys((*names, "ATOMIC", "SLOT_LANES", "GROUP_DEPTH", "DIVERGENT_WARPS"), 0)
    for first in range(0, len(boxes), simt.warp):
        live = ranges[first : first + simt.warp]
        for slot in range(slots**2):
            lanes = {}
            for lane, (x0, y0, x1, y1) in enumerate(live):
                x, y = x0 + slot % slots, y0 + slot // slots
                if x <= x1 and y <= y1:
                    lanes[lane] = (y * columns + x) * padding
            total["SLOT_LANES"] += len(lanes)
            total["DIVERGENT_WARPS"] += 0 < len(lanes) < len(live)
            if aggregate:
                lanes = {lane: w for lane, w in lanes.items() if all(lanes.get(o) != w for o in range(lane))}
            if not lanes:
                continue
            total["ATOMIC"] += 1
            for name, value in zip(names, naive_atomics(list(lanes.values()), simt.atomic_merge), strict=True):
                total[name] += value if name != "LOCK_DEPTH" else 0
            for start in range(0, simt.warp, group):
                part = [word for lane, word in lanes.items() if start <= lane < start + group]
                if part:
                    total["GROUP_DEPTH"] += naive_atomics(part, simt.atomic_merge)[3]
                    total["LOCK_DEPTH"] += naive_atomics(part, simt.atomic_merge)[4]
    return total


def edge(a, b, x, y):
    return F(F(F(b[0] - a[0]) * F(y - a[1])) - F(F(b[1] - a[1]) * F(x - a[0])))


def unpack(color, shift):
    return F((int(color) >> shift) & 255)


def naive_sample(quad, colors, x, y):
    """None where the sample is missed, else z and packed colour (z None where the quad has no area there)."""
    a, b, c, d = quad
    e = [edge(a, b, x, y), edge(b, c, x, y), edge(c, d, x, y), edge(d, a, x, y)]
    if not (all(value >= 0 for value in e) or all(value <= 0 for value in e)):
        return None
    f = edge(a, c, x, y)
    if (f <= 0) == (F(F(F(e[0] + e[1]) + e[2]) + e[3]) >= 0):
        p, color, wa, wb, wc = b, colors[1], e[1], F(-f), e[0]
    else:
        p, color, wa, wb, wc = d, colors[3], e[2], f, e[3]
    total = F(F(wa + wb) + wc)
    if total == 0:
        return None, 0
    r = F(F(1) / total)
    z = F(F(F(F(wa * a[2]) + F(wb * p[2])) + F(wc * c[2])) * r)
    u, v, w = F(wa * r), F(wb * r), F(wc * r)
    packed = 0xFF000000
    for shift in (0, 8, 16):
        value = F(F(u * unpack(colors[0], shift)) + F(v * unpack(color, shift)))
        value = F(F(value + F(w * unpack(colors[2], shift))) + F(0.5))
        packed |= int(max(value, 0)) << shift
    return z, packed


def naive_raster(vertices, lists, tile, columns, width, height, side, warp, box_tests, grid_side=4):
    """Image, depth and events by block, thread by thread."""
    bits = vertices.view(np.uint32)[:, :, 3]
    image = np.zeros((height, width, 3), np.uint8)
    depth = np.zeros((height, width), np.float32)
    names = ("SUBTILE_PASS", "BOX_WARPS", "BOX_LANES", "HIT_WARPS", "HIT_LANES", "Z_WARPS", "Z_LANES", "SAMPLE_TESTS")
    events = [dict.fromkeys(names, 0) for _ in lists]
    for block, members in enumerate(lists):
        left, top = block % columns * tile, block // columns * tile
        zs = {(s, t): F(1) for s in range(side**2) for t in range(tile**2)}
        packed = dict.fromkeys(zs, 0xFF402020)
        for grid in members:
            for q in range((grid_side - 1) ** 2):
                first = q + q // (grid_side - 1)
                corners = [first + o for o in (0, 1, grid_side + 1, grid_side)]
                quad = [vertices[grid, k] for k in corners]
                color = [bits[grid, k] for k in corners]
                x0, x1 = min(k[0] for k in quad), max(k[0] for k in quad)
                y0, y1 = min(k[1] for k in quad), max(k[1] for k in quad)
                for s in range(side**2):
                    size = tile / side
                    sx, sy = left + s % side * size, top + s // side * size
                    if box_tests and (x1 < sx or x0 > sx + size or y1 < sy or y0 > sy + size):
                        continue
                    event = events[block]
                    event["SUBTILE_PASS"] += 1
                    warps = {"BOX": set(), "HIT": set(), "Z": set()}
                    for thread in range(tile**2):
                        x, y = F(sx + (thread % tile + 0.5) / side), F(sy + (thread // tile + 0.5) / side)
                        if box_tests and (x < x0 or x > x1 or y < y0 or y > y1):
                            continue
                        event["BOX_LANES"] += 1
                        warps["BOX"].add(thread // warp)
                        found = naive_sample(quad, color, x, y)
                        if found is None:
                            continue
                        event["HIT_LANES"] += 1
                        warps["HIT"].add(thread // warp)
                        if found[0] is not None and found[0] < zs[s, thread]:
                            event["Z_LANES"] += 1
                            warps["Z"].add(thread // warp)
                            zs[s, thread], packed[s, thread] = found
                    for name, seen in warps.items():
                        event[f"{name}_WARPS"] += len(seen)
                    event["SAMPLE_TESTS"] += len(warps["BOX"]) * min(warp, tile**2)
        for y in range(top, min(top + tile, height)):
            for x in range(left, min(left + tile, width)):
                spots = []
                for j in range(side):
                    for i in range(side):
                        sample_x, sample_y = (x - left) * side + i, (y - top) * side + j
                        s = sample_y // tile * side + sample_x // tile
                        spots.append((s, sample_y % tile * tile + sample_x % tile))
                n = side**2
                image[y, x] = [(sum((packed[k] >> h) & 255 for k in spots) + n // 2) // n for h in (0, 8, 16)]
                depth[y, x] = min(zs[k] for k in spots)
    return image, depth, events
