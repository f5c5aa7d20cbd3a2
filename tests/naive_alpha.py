"""Slow, obvious alpha test: fine raster that discards fragments, and a list of those that wait to be shaded."""

from collections import Counter
from typing import NamedTuple

from tests.naive_fine import OneTile
from tests.naive_warps import WARP


class Test(NamedTuple):
    """Alpha of every fragment by triangle and pixel, the least that is kept, and whether survivors are compacted."""

    alpha: dict
    reference: int
    compact: bool


def tile_with(test):
    """A tile's work, with a test."""
    return lambda *inputs: _AlphaTile(test, *inputs)


def picture(fragments, reference):
    """Triangle and colour of each pixel: of the nearest fragment that is kept, the first of equals."""
    kept = {pixel: [f for f in found if f[0] >> 24 >= reference] for pixel, found in fragments.items()}
    nearest = {pixel: min(found, key=lambda f: f[1]) for pixel, found in kept.items() if found}
    return {pixel: (triangle, color) for pixel, (color, _, triangle) in nearest.items()}


class _AlphaTile(OneTile):
    def __init__(self, test, *inputs):
        super().__init__(*inputs)
        self.test, self.waiting = test, []

    def draw(self):
        super().draw()
        if self.waiting:
            self._shade(self.waiting)
        return self.tally

    def _alpha(self, fragment):
        slot, x, y = fragment
        triangle = int(self.job.setup.inputs[self.job.setup.records[slot]])
        return self.test.alpha[triangle, self.left + x, self.bottom + y]

    def _round(self, now):
        tally = self.tally
        new = {f: self.job.depth_at(f[0], self.left + f[1], self.bottom + f[2]) for f in now}
        old = {f: self.depths[f[1], f[2], 0] for f in now}
        tested = [f for f in now if new[f] < old[f]]
        alive = [f for f in tested if self._alpha(f) >= self.test.reference]
        tally += Counter(SAMPLE_HITS=len(now), Z_KILLS=len(now) - len(tested), DISCARDS=len(tested) - len(alive))
        written = Counter()
        for f in alive:
            if new[f] < self.depths[f[1], f[2], 0]:
                self.depths[f[1], f[2], 0] = self.far_of[f[1:]] = new[f]
                written[f[1:]] += 1
        self.stale |= any(old[f] == self.far for f in alive)
        if tested:
            tally += Counter(ALPHA_ROUNDS=1, ALPHA_LANES=len(tested))
            for part in (1, 2, 3):
                self._records(tested, part)
        if not alive:
            return
        turns = max(written.values())
        tally += Counter(ROP_STEPS=turns, ROP_LANES=sum(written.values()), BLEND_LANES=len(alive))
        tally["BLEND_ROUND_LANES"] += turns * len(alive)
        if not self.test.compact:
            tally += Counter(SHADE_ROUNDS=1, SHADE_LANES=len(alive))
            return
        tally += Counter(COMPACT_ROUNDS=1, COMPACT_LANES=len(alive))
        self.waiting += alive
        if len(self.waiting) >= WARP:
            self._shade(self.waiting[:WARP])
            self.waiting = self.waiting[WARP:]
