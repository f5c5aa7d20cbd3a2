"""A warp's pixels of a tile walk along its list until all of them are done.

What runs here is smarter than what is charged: an entry is evaluated only where the box around its alpha cut-off, made
a little larger, reaches the pixels; elsewhere each evaluation is counted as one whose alpha is too small.
"""

from typing import Any

import numpy as np

from tilestamp.models.bits import popcount
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.blend_step import (
    GX,
    GY,
    LANES,
    LEAST_ALPHA,
    OPACITY,
    A,
    B,
    C,
    blend_step,
)

BOX = 4  # first and last column and row of pixels
NOWHERE, EVERYWHERE = 1 << 30, 1 << 29
# Of a group of pixels:
EVALUATIONS, BLENDED, SKIPPED_POWER, STOPPED, EXP_STEPS, EXP_LANES, BLEND_STEPS, TRIPS, TOTALS = range(9)
# Of a group in a round:
ROUND_BLENDS, ROUND_RUNS, PER_ROUND = range(3)
_MARGIN = 1e-3  # of the exponent
_SLENDER = 2.0**14  # product of the variances over the determinant: beyond, rounding decides too much
_ROUNDING = 2.0**-16


@kernel(lent=True, error_model="numpy")
def reach_box(entry: Any, box: Any) -> None:
    """Find the pixels at which an entry may be seen: those outside have an alpha under 1/255, rounding included."""
    a, b, c, opacity = np.float64(entry[A]), np.float64(entry[B]), np.float64(entry[C]), np.float64(entry[OPACITY])
    x, y = np.float64(entry[GX]), np.float64(entry[GY])
    det = a * c - b * b
    box[0], box[1], box[2], box[3] = -EVERYWHERE, EVERYWHERE, -EVERYWHERE, EVERYWHERE
    if 0.0 <= opacity < 0.999 * np.float64(LEAST_ALPHA):
        box[0], box[1], box[2], box[3] = NOWHERE, -NOWHERE, NOWHERE, -NOWHERE
        return
    if not (a > 0.0 and c > 0.0 and det * _SLENDER > a * c and opacity < 1e6 and abs(x) < 1e6 and abs(y) < 1e6):
        return
    slack = 1.0 + _ROUNDING * (a * c / det)
    reach = (2.0 * np.log(opacity * 255.0) + _MARGIN) * slack + _MARGIN
    if reach > 0.0:
        wide, high = np.sqrt(reach * c / det) + _MARGIN, np.sqrt(reach * a / det) + _MARGIN
        if wide < 1e6 and high < 1e6:
            box[0], box[1] = np.int64(np.floor(x - wide)), np.int64(np.ceil(x + wide))
            box[2], box[3] = np.int64(np.floor(y - high)), np.int64(np.ceil(y + high))


@kernel(lent=True)
def walk(
    entries: Any, boxes: Any, count: int, state: Any, lasts: Any, alive: Any, rectangle: Any, batch: int,
    per_round: Any, marks: Any, bit: Any, totals: Any,
) -> None:  # fmt: skip
    """Walk along a list.

    Parameters
    ----------
    entries : ndarray, (>= count, ENTRY), float32
    boxes : ndarray, (>= count, BOX), int64
    count : int
        Entries.
    state, lasts : ndarray
        As ``blend_step`` takes them, a multiple of 32 lanes.
    alive : ndarray, (lanes / 32,), uint32
        Pixels that are not done, a bit each; changed.
    rectangle : tuple of int
        First and last column and row of the pixels.
    batch : int
        Entries a round.
    per_round : ndarray, (rounds, PER_ROUND), int64
        Added to.
    marks : ndarray, (>= count,), uint32
        Of each entry a bit for each warp in which it blends; those of ``bit`` are set.
    bit : uint32
    totals : ndarray, (TOTALS,), int64
        Added to.
    """
    left, right, top, bottom = rectangle
    living = 0
    for part in range(len(alive)):
        living += popcount(np.uint64(alive[part]))
    blended_before = -2
    k = 0
    while k < count and living:
        box = boxes[k]
        totals[EVALUATIONS] += living
        exp_lanes = living
        if box[0] <= right and box[1] >= left and box[2] <= bottom and box[3] >= top:
            blended, stopped, unbounded = 0, 0, 0
            for part in range(len(alive)):
                if alive[part]:
                    blends, stops, wild = blend_step(state, lasts, part * LANES, alive[part], entries[k], k + 1)
                    blended += popcount(np.uint64(blends))
                    if stops:
                        stopped += popcount(np.uint64(stops))
                        alive[part] = np.uint32(alive[part] & ~stops)
                    if wild:
                        unbounded += popcount(np.uint64(wild))
            living -= stopped
            totals[STOPPED] += stopped
            totals[SKIPPED_POWER] += unbounded
            exp_lanes -= unbounded
            if blended:
                totals[BLENDED] += blended
                totals[BLEND_STEPS] += 1
                per_round[k // batch, ROUND_BLENDS] += 1
                per_round[k // batch, ROUND_RUNS] += k != blended_before + 1
                blended_before = k
                marks[k] |= bit
        totals[EXP_LANES] += exp_lanes
        totals[EXP_STEPS] += exp_lanes > 0
        k += 1
    totals[TRIPS] = k
