"""What bin and coarse raster share: triangles against squares, walked by a warp (Laine & Karras 2011, sections 4, 5).

Both stages ask the same question at two scales: which squares (bins of 2048, tiles of 128 sub-pixels) does a
triangle touch? A lane owns a triangle, walks the squares of its box row by row, and sets its bit in the mask of
every square that passes, by an OR in shared memory. The functions here work on one warp's triangles at a time.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES, WARP_LINES, WARP_SECTORS, smallest_transaction_bytes, transactions
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt

MAX_SQUARES = 256  # that a walk can visit: the bins of a frame, or the tiles of a bin
WARP = 32  # lanes; the original's ballots and its masks of 32 bits know no other width
HEADER_BYTES = 16  # six int16 coordinates and one word
BIN_SIDE_LOG2 = 11  # a bin is 128 pixels of 16 sub-pixels wide
TILE_SIDE_LOG2 = 7  # a tile is 8 pixels wide
SINGLE_TRIANGLE = 7  # low bits of a queue entry whose triangle has its data at its own slot


_32, _64, _96, _128, _160 = np.uint64(32), np.uint64(64), np.uint64(96), np.uint64(128), np.uint64(160)
X, Y, COLUMNS, ROWS = 0, 32, 64, 96  # where those of the lanes begin in ``WarpBoxes.box``


class WarpBoxes(NamedTuple):
    """The triangles of one warp: scratch space of a worker."""

    entry: NDArray[np.int64]  # (32,) as they are queued
    slot: NDArray[np.int64]  # (32,) index of header and data
    corner: NDArray[np.int32]  # (6 * 32,) x0, y0, x1, y1, x2, y2 of the lanes, side by side
    box: NDArray[np.int32]  # (4 * 32,) first column, first row, columns, rows of squares, too
    edge: NDArray[np.int64]  # (32, 3) edge functions at the walk's square, largest over that closed square
    step: NDArray[np.int64]  # (32, 6) dx0 dy0 dx1 dy1 dx2 dy2 times the square's side
    address: NDArray[np.int64]  # (32,) of the lanes, of one instruction
    vote: NDArray[np.uint8]  # (256 * 32,) lanes on each shared memory bank, at each step of a walk
    corners: NDArray[np.int32]  # (32,) boxes at most 2 x 2 by the bank they begin on: all, the wide, the high, both


@kernel
def new_boxes() -> Any:
    """Make room for the triangles of one warp."""
    return WarpBoxes(
        np.zeros(WARP, np.int64),
        np.zeros(WARP, np.int64),
        np.zeros(6 * WARP, np.int32),
        np.zeros(4 * WARP, np.int32),
        np.zeros((WARP, 3), np.int64),
        np.zeros((WARP, 6), np.int64),
        np.zeros(WARP, np.int64),
        np.zeros(MAX_SQUARES * WARP, np.uint8),
        np.zeros(WARP, np.int32),
    )


@kernel(lent=True)
def entry_slot(entry: Any, misc: Any) -> Any:
    """Slot of a queue entry: the triangle's own, or the sub-triangle's in the run that its header's word points to."""
    part = entry & 7
    if part == SINGLE_TRIANGLE:
        return entry >> 3
    return np.int64(misc[entry >> 3]) + part


@kernel(lent=True)
def find_slots(entries: Any, misc: Any, boxes: WarpBoxes) -> bool:
    """Take a warp's queue entries and find their slots; returns whether any of them is not its triangle's own."""
    indirect = False
    for lane in range(entries.size):
        entry = np.int64(entries[lane])
        boxes.entry[lane], boxes.slot[lane] = entry, entry >> 3
        indirect |= entry & 7 != SINGLE_TRIANGLE
    if indirect:
        for lane in range(entries.size):
            boxes.slot[lane] = entry_slot(boxes.entry[lane], misc)
    return indirect


@kernel(lent=True, inline=True)
def _squares(a: Any, b: Any, c: Any, move: int, shift: int, last: int) -> Any:
    """First square, and how many, between three places on an axis."""
    low: Any = np.int32(np.int32(min(a, b, c) + move) >> shift)
    high: Any = np.int32(np.int32(max(a, b, c) + move) >> shift)
    first: Any = min(max(low, np.int32(0)), np.int32(last))
    return first, np.int32(min(max(high, np.int32(0)), np.int32(last)) - first + 1)


@kernel(lent=True)
def warp_boxes(
    boxes: WarpBoxes,
    lanes: int,
    headers: Any,
    move_x: int,
    move_y: int,
    shift: int,
    last_x: int,
    last_y: int,
) -> tuple[int, int, int]:
    """Boxes of the triangles at the slots in squares, clamped; moves take vertices to the region's lower-left corner.

    Returns the squares of the largest box, and of all, and the longest side. Compiled code takes several lanes at once.
    """
    corner, box = boxes.corner, boxes.box
    for lane in range(lanes):
        header = headers[np.uint64(boxes.slot[lane])]
        for k in range(6):
            corner[np.uint64(k * WARP + lane)] = header[k]
    largest: Any = np.int32(1)
    area: Any = np.int32(0)
    side: Any = np.int32(1)
    for lane in range(lanes):
        i = np.uint64(lane)
        x, columns = _squares(corner[i], corner[i + _64], corner[i + _128], move_x, shift, last_x)
        y, rows = _squares(corner[i + _32], corner[i + _96], corner[i + _160], move_y, shift, last_y)
        box[i], box[i + _32], box[i + _64], box[i + _96] = x, y, columns, rows
        squares = np.int32(columns * rows)
        largest, area = max(largest, squares), np.int32(area + squares)
        side = max(side, np.int32(columns), np.int32(rows))
    return int(largest), int(area), int(side)


@kernel(lent=True)
def lane_edges(boxes: WarpBoxes, lane: int, dx: int, dy: int, shift: int) -> None:
    """Edge functions of one triangle at the first square of its box: the largest value over the closed square."""
    side = np.int64(1) << shift
    corner_x, corner_y = boxes.box[X + lane] * side - dx, boxes.box[Y + lane] * side - dy
    for k in range(3):
        i, j = 2 * k * WARP + lane, 2 * ((k + 1) % 3) * WARP + lane
        ax, ay = np.int64(boxes.corner[i]), np.int64(boxes.corner[i + WARP])
        ex, ey = boxes.corner[j] - ax, boxes.corner[j + WARP] - ay
        boxes.step[lane, 2 * k], boxes.step[lane, 2 * k + 1] = ex * side, ey * side
        boxes.edge[lane, k] = (ax - corner_x) * ey - (ay - corner_y) * ex + side * (max(ex, 0) - min(ey, 0))


@kernel(lent=True)
def touches(boxes: WarpBoxes, lane: int, column: int, row: int) -> bool:
    """Whether the triangle touches the closed square (column, row) of its box: no edge has it wholly outside."""
    for k in range(3):
        if boxes.edge[lane, k] - column * boxes.step[lane, 2 * k + 1] + row * boxes.step[lane, 2 * k] < 0:
            return False
    return True


@kernel(lent=True)
def count_votes(boxes: WarpBoxes, steps: int) -> tuple[int, int]:
    """Shared ORs of a warp, one for each of its steps that has a vote, and their replays; the votes are forgotten."""
    ors, replays = 0, 0
    for step in range(steps):
        votes = boxes.vote[step * WARP : (step + 1) * WARP]
        deepest: Any = np.uint8(0)
        for bank in range(WARP):  # all at once
            deepest = max(deepest, votes[bank])
        ors, replays = ors + (deepest > 0), replays + max(int(deepest) - 1, 0)
        for bank in range(WARP):
            votes[bank] = 0
    return ors, replays


@kernel(lent=True)
def count_corners(corners: Any) -> tuple[int, int]:
    """As ``count_votes``, of boxes that are at most 2 x 2: a step for each corner, a byte of each bank's number."""
    ors, replays = 0, 0
    for corner in range(4):
        shift = np.int32(8 * corner)
        deepest: Any = np.int32(0)
        for bank in range(WARP):
            deepest = max(deepest, np.int32(corners[bank] >> shift & np.int32(255)))
        ors, replays = ors + (deepest > 0), replays + max(int(deepest) - 1, 0)
    for bank in range(WARP):
        corners[bank] = 0
    return ors, replays


@kernel(lent=True)
def row_ends(boxes: WarpBoxes, lanes: int, steps: int) -> int:
    """Steps at which a lane of a warp that walks its boxes ends a row."""
    ends = 0
    for step in range(steps):
        end = False
        for lane in range(lanes):
            columns = np.int64(boxes.box[COLUMNS + lane])
            end |= step < columns * boxes.box[ROWS + lane] and step % columns == columns - 1
        ends += end
    return ends


@kernel
def with_room(pairs: Any, used: int, more: int) -> Any:
    """Pairs of a square and an entry, (n, 2), in a larger array, with room for ``more`` behind those in use."""
    larger = np.empty((2 * len(pairs) + more, 2), np.int32)
    for i in range(used):
        larger[i, 0], larger[i, 1] = pairs[i, 0], pairs[i, 1]
    return larger


@kernel
def place_pairs(pairs: Any, cursors: Any, entries: Any) -> None:
    """Write the entries of pairs where the cursors of their squares stand."""
    for i in range(len(pairs)):
        square = np.uint32(pairs[i, 0])
        entries[np.uint64(cursors[square])] = pairs[i, 1]
        cursors[square] += 1


@kernel(lent=True)
def header_load(boxes: WarpBoxes, lanes: int, segment_bytes: int) -> tuple[int, int]:
    """Transactions and bytes of a warp's load of its triangles' headers, 16 bytes a lane."""
    for lane in range(lanes):
        boxes.address[lane] = boxes.slot[lane] * HEADER_BYTES
    rule = WARP_SECTORS if segment_bytes == SECTOR_BYTES else WARP_LINES
    count, size = transactions(boxes.address, lanes, HEADER_BYTES, rule)
    return count, size


def transaction_bytes(simt: Simt, stage: str) -> int:
    """Bytes of one memory transaction; refuses a machine that cannot run the original.

    Parameters
    ----------
    simt : Simt
        The machine's shape.
    stage : str
        Who asks, for the message.

    Returns
    -------
    int
        128 (lines) or 32 (sectors).

    Raises
    ------
    TilestampError
        Where the machine has no ballots over warps of 32 (compute capability below 2.0).
    """
    if not simt.votes:
        raise TilestampError(f"{stage}: cudaraster votes over warps of 32 and needs compute capability 2.0 or later")
    return int(smallest_transaction_bytes(int(simt.coalescing)))
