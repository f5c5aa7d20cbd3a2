"""Slow, obvious counts of fine raster: every event of a launch, by name (Laine & Karras 2011, section 6).

A tile is drawn by one warp: it reads its list 32 entries at a time, and distributes the fragments of the triangles
that it has queued, 32 a round. Coverage and depths are those of ``naive_cudaraster``, in integers.
"""

from collections import Counter
from typing import NamedTuple

from tests import naive_cudaraster as naive
from tests.naive_warps import WARP, Tally
from tilestamp.models.coalescing import contiguous, smallest_transaction_bytes

FAR = 2**32 - 1 - 17600  # depth of a cleared pixel


class Job(NamedTuple):
    """One draw."""

    setup: object
    width: int
    height: int
    simt: object
    later_wins: bool  # nvdiffrast
    samples: int
    depth: bool
    blend: bool
    write_color: bool
    interpolate: bool

    @property
    def log_samples(self):
        """Of 1, 2, 4 or 8 samples: 0 to 3."""
        return self.samples.bit_length() - 1

    def corners(self, slot):
        """Corners in 1/16 pixel from the lower left."""
        h = [int(c) for c in self.setup.headers[slot]]
        return [(h[2 * k] + 8 * self.width, h[2 * k + 1] + 8 * self.height) for k in range(3)]

    def depth_at(self, slot, sx, sy):
        """Depth of a triangle's plane at a sample."""
        zx, zy, zb = (int(c) for c in self.setup.planes[self.setup.records[slot]][:3])
        return (zx * sx + zy * sy + zb) % 2**32

    def covered(self, slot, x, y):
        """Samples of a pixel that a triangle covers."""
        step = 16 // self.samples
        places = [(x * self.samples + c, y * self.samples + k) for k, c in enumerate(naive.PATTERN[self.samples])]
        inside = [naive.covers(self.corners(slot), sx * step + step // 2, sy * step + step // 2) for sx, sy in places]
        return [(k, *place) for k, (place, hit) in enumerate(zip(places, inside, strict=True)) if hit]


def fine(job, starts, entries, active, new_tile=None, warps=20):
    """Every event of the launch of ``warps`` warps a block; ``starts`` and ``entries`` are the tiles' lists."""
    tally = Tally()
    size = smallest_transaction_bytes(int(job.simt.coalescing))
    columns = -(-job.width // 8)
    for t in map(int, active):
        listed = [int(e) for e in entries[starts[t] : starts[t + 1]]]
        tally += (new_tile or OneTile)(job, 8 * (t % columns), 8 * (t // columns), listed).draw()
        rows = (1 + (job.write_color or job.later_wins)) * 8 * job.samples  # of 32 bytes, that the clear writes
        tally += Counter(ATOMIC=1, TILE_STORES=1, STORE_TRANSACTIONS=rows, STORE_BYTES=32 * rows)
        tally += Counter(LOAD_TRANSACTIONS=2, LOAD_BYTES=2 * size)  # the tile's number and its first segment
    warps *= job.simt.sms  # each starts, and finds no tile at its last draw
    loads = 3 * warps + tally["ATOMIC"] + warps  # and with each draw the number of tiles
    tally += Counter(WARP_STARTS=warps, ATOMIC=warps, LOAD_TRANSACTIONS=loads, LOAD_BYTES=loads * size)
    for name in ("ATOMIC_LANES", "ATOMIC_REQUESTS", "ATOMIC_DEPTH"):
        tally[name] = tally["ATOMIC"]
    return tally


class OneTile:
    """What a warp does for one tile."""

    def __init__(self, job, left, bottom, listed):
        self.job, self.tally, self.left, self.bottom, self.listed = job, Tally(), left, bottom, listed
        self.depths = {(x, y, k): FAR for x in range(8) for y in range(8) for k in range(job.samples)}
        self.far_of = {(x, y): FAR for x in range(8) for y in range(8)}  # a pixel's farthest sample
        self.far, self.stale, self.fragments = FAR, False, []  # (slot, x, y), in order of slots and pixels

    def draw(self):
        """All of the tile's list."""
        while True:
            if len(self.fragments) < WARP and self.listed:
                if self.job.depth and self.stale:
                    self.far, self.stale = max(self.far_of.values()), False
                    self.tally["ZMAX_UPDATES"] += 1
                self.tally["REFILLS"] += 1
                while len(self.fragments) < WARP and self.listed:
                    self._read()
            if not self.fragments:
                return self.tally
            queued = min(len({slot for slot, _, _ in self.fragments}), WARP)
            now, self.fragments = self.fragments[:WARP], self.fragments[WARP:]
            self.tally += Counter(FRAGMENT_ROUNDS=1, FRAGMENT_LANES=len(now))
            if self.job.depth:
                self._records(now, 0)
            if self.job.samples == 1:
                self.tally += Counter(TAG_WARPS=1, TAG_LANES=queued)
                self._round(now)
            else:
                self._sampled_round(now)

    def _read(self):
        """Up to 32 entries: early z against the farthest depth of the tile, then the mask of pixels."""
        now, self.listed = self.listed[:32], self.listed[32:]
        job, tally = self.job, self.tally
        nearest = {slot: int(job.setup.misc[slot]) & 0xFFFFF000 for slot in now}
        behind = [
            s for s in now if job.depth and (nearest[s] > self.far or (nearest[s] == self.far and not job.later_wins))
        ]
        seen = [slot for slot in now if slot not in behind]
        masks = {slot: self._mask(slot) for slot in seen}
        full = [slot for slot in seen if masks[slot]]
        self.fragments += [(slot, x, y) for slot in full for x, y in masks[slot]]
        loads, moved = contiguous(0, 4 * len(now), int(job.simt.coalescing))
        size = smallest_transaction_bytes(int(job.simt.coalescing))
        tally += Counter(
            SEGMENTS=1, LIST_WARPS=1, ENTRY_LANES=len(now), EARLY_Z_LANES=len(now) * job.depth,
            EARLY_Z_KILLS=len(behind), COVERAGE_LANES=len(seen), EMPTY_MASKS=len(seen) - len(full),
            SAMPLE_TESTS=64 * len(seen), FULL_SEGMENTS=int(bool(full)), FULL_LANES=len(full),
            PARTIAL_SEGMENTS=int(len(now) < 32), LOAD_TRANSACTIONS=loads + 2, LOAD_BYTES=moved + 2 * size,
        )  # fmt: skip
        tally.load([16 * slot for slot in now], 16, job.simt)

    def _mask(self, slot):
        """Pixels of the tile in the order of a mask's bits: rows upwards, the rightmost first."""
        pixels = [(x, y) for y in range(8) for x in reversed(range(8))]
        inside = self._touches if self.job.samples > 1 else lambda s, x, y: bool(self.job.covered(s, x, y))
        return [(x, y) for x, y in pixels if inside(slot, self.left + x, self.bottom + y)]

    def _touches(self, slot, x, y):
        """Whether no edge has all four corners of a pixel on its outer side, by the tie rule."""
        corners = self.job.corners(slot)
        for k in range(3):
            (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 3]
            dx, dy = bx - ax, by - ay
            least = 1 if dy > 0 or (dy == 0 and dx <= 0) else 0
            squares = [(16 * x + i, 16 * y + j) for i in (0, 16) for j in (0, 16)]
            if all(naive.cross(ax - px, ay - py, dx, dy) < least for px, py in squares):
                return False
        return True

    def _records(self, lanes, part):
        """A load of 16 bytes of the data record by each lane."""
        record = self.job.setup.planes.shape[1] * 4
        self.tally.load([record * slot + 16 * part for slot, *_ in lanes], 16, self.job.simt)

    def _shade(self, kept):
        self.tally += Counter(SHADE_ROUNDS=1, SHADE_LANES=len(kept))
        if not self.job.later_wins:
            for part in (1, 2, 3) if self.job.interpolate else (3,):
                self._records(kept, part)

    def _round(self, now):
        job, tally = self.job, self.tally
        tally["SAMPLE_HITS"] += len(now)
        kept = now
        if job.depth:
            new = {f: job.depth_at(f[0], self.left + f[1], self.bottom + f[2]) for f in now}
            old = {(x, y): self.depths[x, y, 0] for _, x, y in now}
            kept = [f for f in now if new[f] < old[f[1:]] or (job.later_wins and new[f] == old[f[1:]])]
            self.stale |= any(old[f[1:]] == self.far for f in kept)
            tally["Z_KILLS"] += len(now) - len(kept)
        written = Counter()
        for f in kept:
            if job.depth:
                before = self.depths[f[1], f[2], 0]
                if new[f] > before or (new[f] == before and not job.later_wins):
                    continue
                self.depths[f[1], f[2], 0] = self.far_of[f[1:]] = new[f]
            written[f[1:]] += 1
        if not kept:
            return
        turns = max(written.values()) if (job.depth or job.blend) and not job.later_wins else 1
        self._shade(kept)
        tally += Counter(
            ROP_STEPS=turns, ROP_LANES=sum(written.values()), BLEND_LANES=len(kept), BLEND_ROUND_LANES=turns * len(kept)
        )
        if job.later_wins:
            crowd = max(Counter(f[1:] for f in kept).values())
            tally += Counter(SHARED_ATOMIC=2, BANK_REPLAYS=2 * (crowd - 1))

    def _hidden(self, slot, x, y):
        """Whether a fragment lies behind all samples of its pixel, by the nearest depth that its plane has there."""
        far, s = self.far_of[x - self.left, y - self.bottom], self.job.log_samples
        zx, zy, zb, slope = (int(c) for c in self.job.setup.planes[self.job.setup.records[slot]][:4])
        nearest = (((zx + zy) << (s - 1)) + ((zx * x + zy * y) << s) + zb - slope) % 2**32
        sure = far <= nearest < (nearest + 2 * slope) % 2**32
        return sure or int(self.job.setup.misc[slot]) & 0xFFFFF000 >= far

    def _sampled_round(self, now):
        job, tally = self.job, self.tally
        hits = {f: job.covered(f[0], self.left + f[1], self.bottom + f[2]) for f in now}
        hidden = [f for f in now if job.depth and self._hidden(f[0], self.left + f[1], self.bottom + f[2])]
        kept = [f for f in now if f not in hidden and hits[f]]
        tally += Counter(
            Z_KILLS=len(hidden), MSAA_KILLS=len(now) - len(hidden) - len(kept), SAMPLE_TESTS=job.samples * len(now),
            SAMPLE_HITS=sum(map(len, hits.values())),
        )  # fmt: skip
        if not kept:
            return
        self._shade(kept)
        for k in range(job.samples):
            self._write_sample(k, kept, hits)
        for _, x, y in kept if job.depth else ():
            farthest = max(self.depths[x, y, k] for k in range(job.samples))
            if farthest < self.far_of[x, y]:
                self.stale |= self.far_of[x, y] == self.far
                self.far_of[x, y] = farthest

    def _write_sample(self, k, kept, hits):
        """One sample of all survivors, in order; a row of the tile is one segment of 32 bytes."""
        job, written = self.job, Counter()
        for f in kept:
            for at, sx, sy in hits[f]:
                place = (f[1], f[2], k)
                if at == k and (not job.depth or job.depth_at(f[0], sx, sy) < self.depths[place]):
                    if job.depth:
                        self.depths[place] = job.depth_at(f[0], sx, sy)
                    written[f[1:]] += 1
        turns = max(written.values(), default=0)
        turns = turns if job.depth or job.blend else min(turns, 1)
        if written:
            self.tally += Counter(
                ROP_STEPS=turns, ROP_LANES=sum(written.values()), BLEND_LANES=len(kept),
                BLEND_ROUND_LANES=turns * len(kept),
            )  # fmt: skip
        rows = len({y for _, _, y in kept})
        mine = len({f[2] for f in kept if any(at == k for at, _, _ in hits[f])})
        loads = rows * job.depth + turns * mine * job.blend
        stores = turns * mine * job.write_color + mine * (job.depth and turns > 0)
        self.tally += Counter(
            LOAD_TRANSACTIONS=loads, LOAD_BYTES=32 * loads, STORE_TRANSACTIONS=stores, STORE_BYTES=32 * stores
        )
