"""The words of a patch's bit mask: rows of the patch's box, the samples of a row next to each other, 32 to a word."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import snap
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, pixel_box

WORD = 32  # bits


@kernel(lent=True)
def patch_box(
    vertices: Any, first: int, last: int, boxes: Any, snapped: Any, samples: Samples
) -> tuple[int, int, int, int]:
    """Pixels (x0, y0, x1, y1) of a patch's polygons that are on screen; dicing knows the box, so nothing is counted."""
    low_x, low_y, high_x, high_y = samples.width, samples.height, -1, -1
    for p in range(first, last):
        snap(vertices[p], boxes, snapped)
        x0, y0, x1, y1 = pixel_box(boxes, samples.width, samples.height)
        if x1 >= x0 and y1 >= y0:
            low_x, low_y = min(low_x, x0), min(low_y, y0)
            high_x, high_y = max(high_x, x1), max(high_y, y1)
    return low_x, low_y, high_x, high_y


@kernel
def new_mask(box: Any, spp: int, layers: int, with_depth: bool) -> tuple[Any, Any]:
    """Make a clear mask (layers, rows, words), and the patch's nearest depths (rows, samples) where they are kept."""
    rows = box[3] - box[1] + 1
    words = -(-(box[2] - box[0] + 1) * spp // WORD)
    kept = rows if with_depth else 0
    return np.zeros((layers, rows, words), np.uint32), np.full((kept, words * WORD), np.inf, np.float32)


@kernel(lent=True)
def next_word(box: Any, spp: int, mask: Any, nearest: Any, in_sequence: Any, walk: Any, depths: Any) -> tuple[int, int]:
    """Read words until one has a sample to test, or the lane's box ends; returns words read, depths looked up.

    In sequence, what the patch has at equal depth is an earlier polygon and wins; in flight it may be a later.

    A lane's walk is x0, y0, x1, y1 in pixels, row, word, pending bits, mask layer; word is -1 at the start of a row.
    """
    reads, looked = 0, 0
    low = (walk[0] - box[0]) * spp
    high = (walk[2] - box[0] + 1) * spp - 1
    while walk[6] == 0 and walk[4] <= walk[3]:
        walk[5] = low // WORD if walk[5] < 0 else walk[5] + 1
        if walk[5] > high // WORD:
            walk[4] += 1
            walk[5] = -1
            continue
        reads += 1
        word = np.int64(mask[walk[7], walk[4] - box[1], walk[5]])
        first, last = max(low - WORD * walk[5], 0), min(high - WORD * walk[5], WORD - 1)
        span = ((1 << (last + 1)) - 1) & ~((1 << first) - 1)
        walk[6] = span & ~word
        if len(nearest) > 0:
            found = span & word
            for bit in range(WORD):
                if (found >> bit) & 1:
                    looked += 1
                    before, front = nearest[walk[4] - box[1], WORD * walk[5] + bit], _front(depths)
                    if before > front or (before == front and not in_sequence):
                        walk[6] |= 1 << bit
    return reads, looked


@kernel
def _front(depths: Any) -> Any:
    """Nearest vertex of a polygon: no depth in it is less, even rounded; a triangle repeats vertex 0 in row 1."""
    return np.float32(min(depths[0, 0], depths[0, 1], depths[0, 2], depths[1, 2]))
