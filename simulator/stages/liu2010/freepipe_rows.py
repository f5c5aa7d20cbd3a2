"""FreePipe, the lanes of a warp in one row of their boxes: which columns their triangles cover, which steps hit.

Nothing here takes a pixel at a time: loops go over the lanes, and compiled code takes several of them at once.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_lanes import WARP, FrameShape, Lanes
from tilestamp.simulator.stages.liu2010.freepipe_triangle import SUBPIXEL_BITS, Pieces

_PIXEL = float(1 << SUBPIXEL_BITS)
_HALF = _PIXEL / 2


@kernel(lent=True)
def take_boxes(pieces: Pieces, lanes: Lanes, shape: FrameShape, row: Any) -> int:
    """Fetch corners and box of each lane's piece; returns the most rows of any.

    No branch: a lane without a piece has the first piece's corners, and no rows.
    """
    active, boxes, most, lane_rows, tests = 0, 0, 0, 0, 0
    box, corner, shift = lanes.box, lanes.corner, shape.unroll_log2
    for lane in range(WARP):
        p = np.uint64(max(lanes.piece[lane], 0))
        x0, x1, y0, y1 = pieces.box[p, 0], pieces.box[p, 1], pieces.box[p, 2], pieces.box[p, 3]
        has = (lanes.piece[lane] >= 0) & (x1 >= x0) & (y1 >= y0)
        box[lane], box[WARP + lane] = x0, y0
        box[2 * WARP + lane], box[3 * WARP + lane] = (y1 - y0 + 1, x1 - x0 + 1) if has else (0, 0)
        for k in range(6):
            corner[k * WARP + lane] = pieces.corner[p, k]
    for lane in range(WARP):  # several at once
        rows, columns = int(box[2 * WARP + lane]), int(box[3 * WARP + lane])
        box[4 * WARP + lane], box[5 * WARP + lane] = columns - (columns >> shift << shift), columns >> shift
        active += lanes.piece[lane] >= 0
        boxes += rows > 0
        most = max(most, rows)
        lane_rows += rows
        tests += rows * columns
    row[FreePipeEvent.SETUP_STEPS] += 1
    row[FreePipeEvent.SETUP_LANES] += active
    row[FreePipeEvent.BOX_STEPS] += boxes > 0
    row[FreePipeEvent.BOX_LANES] += boxes
    row[FreePipeEvent.ROW_STEPS] += most
    row[FreePipeEvent.ROW_LANES] += lane_rows
    row[FreePipeEvent.SAMPLE_TESTS] += tests
    return most


@kernel(lent=True)
def start_lanes(lanes: Lanes, width: int) -> None:
    """Edge functions at the boxes' first pixels, as ``start_edges`` has them."""
    box, corner, edge = lanes.box, lanes.corner, lanes.edge
    for lane in range(WARP):
        lanes.first[lane] = np.int64(box[WARP + lane]) * width + box[lane]
    for lane in range(WARP):
        x, y = np.float64(box[lane]) * _PIXEL + _HALF, np.float64(box[WARP + lane]) * _PIXEL + _HALF
        for k in range(3):
            j = (k + 1) % 3
            ax, ay = np.float64(corner[2 * k * WARP + lane]), np.float64(corner[(2 * k + 1) * WARP + lane])
            dx, dy = corner[2 * j * WARP + lane] - ax, corner[(2 * j + 1) * WARP + lane] - ay
            others = 0.0 if dy < 0.0 or (dy == 0.0 and dx > 0.0) else 1.0
            edge[k * WARP + lane] = dx * (y - ay) - dy * (x - ax) - others
            edge[(3 + k) * WARP + lane], edge[(6 + k) * WARP + lane] = dx * _PIXEL, dy * _PIXEL


@kernel(lent=True)
def longest(box: Any, r: int) -> tuple[int, int]:
    """Longest way of the lanes that have row r: pixels beyond whole turns of any, and whole turns of any."""
    rest, turns = np.int32(0), np.int32(0)
    here = np.int32(r)
    for lane in range(WARP):
        has = here < box[2 * WARP + lane]
        rest = max(rest, box[4 * WARP + lane] if has else np.int32(0))
        turns = max(turns, box[5 * WARP + lane] if has else np.int32(0))
    return int(rest), int(turns)


@kernel(error_model="numpy", lent=True)
def cover_row(edge: Any, box: Any, span: Any, r: int) -> None:
    """Columns of row r that the lanes' triangles cover; then step up to the next row.

    A row of a triangle has no gaps: it lies between the columns at which the edge functions change sign. Those are
    whole numbers of so few bits that a quotient in float64 is on the right side of the next whole number.
    """
    here = np.int32(r)
    for lane in range(WARP):
        end = np.float64(box[3 * WARP + lane] if here < box[2 * WARP + lane] else np.int32(0))
        first, last = np.float64(0), end
        for k in range(3):
            value, left = edge[k * WARP + lane], edge[(6 + k) * WARP + lane]
            crossing = value / left
            beyond, low = np.floor(crossing) + 1.0, np.ceil(crossing)
            last = beyond if left > 0.0 and beyond < last else last
            first = low if left < 0.0 and low > first else first
            first = end if left == 0.0 and value < 0.0 else first
            edge[k * WARP + lane] = value + edge[(3 + k) * WARP + lane]
        first = min(first, end)
        last = max(first, last)
        span[lane], span[WARP + lane] = np.int32(first), np.int32(last)


@kernel(lent=True)
def find_steps(lanes: Lanes, turns: bool) -> None:
    """Steps that hit, of the loop over a row's first columns or of the unrolled one over whole turns (``turns``)."""
    span, box, step = lanes.span, lanes.box, lanes.step
    for lane in range(WARP):
        rest = box[4 * WARP + lane]
        begin, end = (rest, span[WARP + lane]) if turns else (np.int32(0), min(span[WARP + lane], rest))
        first = max(span[lane], begin)
        step[lane], step[WARP + lane] = first - begin, max(end - first, 0)
    for lane in range(WARP):
        lanes.here[lane] = lanes.first[lane] + (box[4 * WARP + lane] if turns else 0)


@kernel(lent=True)
def hit_lanes(step: Any, c: int) -> Any:
    """Lanes that hit in step c, a bit each."""
    bits = np.uint32(0)
    here = np.uint32(c)
    for lane in range(WARP):
        hit = np.uint32(here - step[lane]) < step[WARP + lane]
        bits |= np.uint32(hit) << np.uint32(lane)
    return np.uint64(bits)
