"""A warp's pixels of a tile walk along its list until all of them are done.

What runs here is smarter than what is charged: an entry is evaluated only where the box around its alpha cut-off, made
a little larger, reaches the pixels; elsewhere each evaluation is counted as one whose alpha is too small.
"""

from typing import Any

import numpy as np

from tilestamp.models.bits import popcount
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.blend_step import LANES, LEAST_ALPHA, blend_step

BOX = 4  # first and last column and row of pixels
WIDE, HIGH, LEAST_POWER, REACH = range(4)  # of a Gaussian: half its box, and the power below which alpha is too small
# Of a group of pixels:
EVALUATIONS, BLENDED, SKIPPED_POWER, STOPPED, BOUNDED_STEPS, BLEND_STEPS, TRIPS, WALKED, TOTALS = range(9)
# Of a group in a round:
ROUND_BLENDS, ROUND_RUNS, ROUND_VISITS, PER_ROUND = range(4)
MASK_GROUP = 32  # entries whose boxes a warp compares at once with the pixels that are not done
FAR, FARTHEST = np.float32(2.0**24), np.float32(2.0**26)  # pixels: a place is moved no farther off, and seen from there
_MARGIN = 1e-3  # of the exponent and of the box
_SLENDER = 2.0**14  # product of the variances over the determinant: beyond, rounding decides too much
_ROUNDING = 2.0**-16


@kernel(lent=True, error_model="numpy")
def visible_reach(conic: Any, reach: Any) -> None:
    """Find how far a Gaussian may be seen: beyond, its alpha is under 1/255, rounding included.

    Where nothing of the kind is certain (slivers, opacities that are none), it is seen everywhere.
    """
    a, b, c, opacity = np.float64(conic[0]), np.float64(conic[1]), np.float64(conic[2]), np.float64(conic[3])
    det = a * c - b * b
    reach[WIDE], reach[HIGH], reach[LEAST_POWER] = FARTHEST, FARTHEST, -np.inf
    if 0.0 <= opacity < 0.999 * np.float64(LEAST_ALPHA):
        reach[WIDE], reach[HIGH], reach[LEAST_POWER] = -FARTHEST, -FARTHEST, np.inf
    elif a > 0.0 and c > 0.0 and det * _SLENDER > a * c and opacity < 1e6:
        power = np.log(opacity * 255.0) + _MARGIN
        square = max(2.0 * power * (1.0 + _ROUNDING * (a * c / det)) + _MARGIN, 0.0)
        reach[WIDE] = min(np.sqrt(square * c / det) * (1.0 + _MARGIN) + _MARGIN, FARTHEST)
        reach[HIGH] = min(np.sqrt(square * a / det) * (1.0 + _MARGIN) + _MARGIN, FARTHEST)
        reach[LEAST_POWER] = -power - _MARGIN


@kernel(lent=True)
def reach_box(x: Any, y: Any, reach: Any, box: Any) -> None:
    """Give the columns and rows of pixels within reach of a place."""
    x, y = min(max(x, -FAR), FAR), min(max(y, -FAR), FAR)  # NaN, too, becomes a number
    box[0], box[1] = np.int32(np.floor(x - reach[WIDE])), np.int32(np.ceil(x + reach[WIDE]))
    box[2], box[3] = np.int32(np.floor(y - reach[HIGH])), np.int32(np.ceil(y + reach[HIGH]))


@kernel(lent=True)
def touches(box: Any, rectangle: Any, live: Any) -> bool:
    """Whether a pixel lies in the box whose bit is set in ``live``; rows of the rectangle follow each other there."""
    left, right, top, bottom = rectangle
    first, last = np.int64(max(box[0], left) - left), np.int64(min(box[1], right) - left)
    if last < first:
        return False
    bits = (np.uint64(1) << np.uint64(last - first + 1)) - np.uint64(1)
    for y in range(max(box[2], top), min(box[3], bottom) + 1):
        if live & (bits << np.uint64((y - top) * (right - left + 1) + first)):
            return True
    return False


@kernel(lent=True)
def walk(
    entries: Any, boxes: Any, count: int, state: Any, lasts: Any, alive: Any, rectangle: Any, batch: int,
    per_round: Any, marks: Any, uses: Any, bit: Any, totals: Any, masked: int,
) -> None:  # fmt: skip
    """Walk along a list.

    Parameters
    ----------
    entries : ndarray, (>= count, ENTRY), float32
    boxes : ndarray, (>= count, BOX), int32
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
    uses : ndarray, (>= count, 2), int64
        Of each entry the pixels, and the steps of warps, that blend it; added to.
    bit : uint32
    totals : ndarray, (TOTALS,), int64
        Added to.
    masked : int
        1 where entries are skipped whose box had no pixel that is not done when their group of 32 was begun.
    """
    left, right, top, bottom = rectangle
    living = 0
    for part in range(len(alive)):
        living += popcount(np.uint64(alive[part]))
    k, visited, counted, before, unbounded_steps, live = 0, 0, 0, -2, 0, np.uint64(0)
    while k < count and living:
        if masked:
            if k % MASK_GROUP == 0:
                live = np.uint64(alive[0])
                if len(alive) > 1:
                    live |= np.uint64(alive[1]) << np.uint64(LANES)
            if not touches(boxes[k], rectangle, live):
                k += 1
                continue
            per_round[k // batch, ROUND_VISITS] += 1
        visited += 1
        if boxes[k, 0] <= right and boxes[k, 1] >= left and boxes[k, 2] <= bottom and boxes[k, 3] >= top:
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
            if unbounded:
                totals[SKIPPED_POWER] += unbounded
                unbounded_steps += unbounded == living
            if stopped:
                totals[EVALUATIONS] += living * (visited - counted)
                counted = visited
                living -= stopped
                totals[STOPPED] += stopped
            if blended:
                totals[BLENDED] += blended
                totals[BLEND_STEPS] += 1
                per_round[k // batch, ROUND_BLENDS] += 1
                per_round[k // batch, ROUND_RUNS] += k != before + 1
                before = k
                marks[k] |= bit
                uses[k, 0] += blended
                uses[k, 1] += 1
        k += 1
    totals[EVALUATIONS] += living * (visited - counted)
    totals[TRIPS], totals[WALKED] = visited, k
    totals[BOUNDED_STEPS] = visited - unbounded_steps
