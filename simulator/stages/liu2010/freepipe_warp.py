"""FreePipe, one warp: lanes in lockstep, as long as the largest triangle among them (Liu et al. 2010).

A thread scans its triangle's box in two nested loops. Lanes come together again after each row, so a warp runs, for
each row that any lane still has, as many steps as the widest box among those lanes. Lanes whose triangle needs no
clipping go first; then the others scan the triangles of their clipped polygons, one after another.
"""

from typing import Any

import numpy as np

from tilestamp.models.atomics import CHUNK_BYTES, SECTOR
from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_lanes import SLOTS, WARP, FrameShape, Lanes, new_lanes
from tilestamp.simulator.stages.liu2010.freepipe_triangle import (
    CLIPPED,
    INSIDE,
    SUBPIXEL_BITS,
    Pieces,
    fixed_depth,
    start_edges,
)

INDEX_BYTES = 4
POSITION_BYTES = 16
WIDE = 8  # bytes of a fragment in one word


@kernel(lent=True)
def _count_vertices(triangles: Any, t0: int, lanes: int, simt: Simt, address: Any, row: Any) -> None:
    """Count loads of three indices and three positions a lane."""
    for k in range(3):
        for lane in range(lanes):
            address[lane] = (t0 + lane) * 3 * INDEX_BYTES + INDEX_BYTES * k
        count, size = transactions(address, lanes, INDEX_BYTES, simt.coalescing)
        for lane in range(lanes):
            address[lane] = np.int64(triangles[t0 + lane, k]) * POSITION_BYTES
        more, more_size = transactions(address, lanes, POSITION_BYTES, simt.coalescing)
        row[FreePipeEvent.LOAD_TRANSACTIONS] += count + more
        row[FreePipeEvent.LOAD_BYTES] += size + more_size


@kernel(lent=True)
def _start_rows(pieces: Pieces, lanes: Lanes) -> tuple[int, int, int]:
    """Set each lane up at its box's first pixel; returns lanes with a piece, those with a pixel, and the most rows."""
    active, boxes, most = 0, 0, 0
    for lane in range(WARP):
        p = lanes.piece[lane]
        if p >= 0:
            active += 1
            box = pieces.box[p]
            start_edges(pieces.corner[p], SUBPIXEL_BITS, box[0], box[2], lanes.row[lane])
            lanes.row_depth[lane] = pieces.depth[p, 0]
            if box[1] >= box[0] and box[3] >= box[2]:
                boxes += 1
                most = max(most, int(box[3] - box[2] + 1))
    return active, boxes, most


@kernel(lent=True)
def _start_row(pieces: Pieces, lanes: Lanes, r: int, width: int, unroll: int) -> tuple[int, int, int]:
    """Let the lanes that have row r begin it; returns how many those are, and their longest way through its pixels.

    That is the most pixels of any beyond a multiple of ``unroll``, and the most turns of ``unroll`` pixels of any.
    """
    active, rest, turns = 0, 0, 0
    for lane in range(WARP):
        p = lanes.piece[lane]
        if p >= 0 and pieces.box[p, 2] + r <= pieces.box[p, 3] and pieces.box[p, 1] >= pieces.box[p, 0]:
            lanes.row_lane[active] = lane
            lanes.row_pixel[active] = (np.int64(pieces.box[p, 2]) + r) * width + pieces.box[p, 0]
            columns = np.uint32(pieces.box[p, 1] - pieces.box[p, 0] + 1)  # divided faster than a signed number
            lanes.row_columns[active], lanes.row_rest[active] = columns, columns % np.uint32(unroll)
            rest = max(rest, int(lanes.row_rest[active]))
            turns = max(turns, int(np.int64(columns // np.uint32(unroll))))
            active += 1
            for k in range(3):
                lanes.pixel[lane, k] = lanes.row[lane, k]
                lanes.row[lane, k] += lanes.row[lane, 3 + 2 * k]
            lanes.depth[lane] = lanes.row_depth[lane]
            lanes.row_depth[lane] += pieces.depth[p, 2] * np.float32(16)
    return active, rest, turns


@kernel(lent=True)
def _step(
    pieces: Pieces, lanes: Lanes, active: int, c: int, rest: int, word_bytes: int, ids: Any
) -> tuple[int, int, int]:
    """Test a pixel of the row of every lane that has one in step c; returns lanes in the row, tests and hits.

    A lane first tests what its row has beyond whole turns of the loop, in the first ``rest`` steps of the warp. After
    those, lanes that have no such pixel leave the row, and the others close up.
    """
    tests, hits, stay = 0, 0, 0
    for i in range(active):
        lane, first, columns, beyond = lanes.row_lane[i], lanes.row_pixel[i], lanes.row_columns[i], lanes.row_rest[i]
        mine = beyond if c < rest else columns - beyond + rest
        if c >= mine and c >= rest:
            continue
        if stay < i:
            lanes.row_lane[stay], lanes.row_pixel[stay] = lane, first
            lanes.row_columns[stay], lanes.row_rest[stay] = columns, beyond
        stay += 1
        if c >= mine:
            continue
        lanes.row_pixel[stay - 1] += 1
        tests += 1
        f = lanes.pixel[lane]
        if f[0] | f[1] | f[2] >= 0:
            lanes.address[hits] = first * word_bytes
            if ids:
                lanes.value[hits] = np.uint64(fixed_depth(lanes.depth[lane]) << 32) | np.uint64(lane + 1)
            hits += 1
        for k in range(3):
            f[k] -= lanes.row[lane, 4 + 2 * k]
        lanes.depth[lane] += pieces.depth[lanes.piece[lane], 1] * np.float32(16)
    return stay, tests, hits


@kernel(lent=True)
def _early(lanes: Lanes, hits: int, t0: int, frame: Any, word_bytes: int, simt: Simt, row: Any) -> int:
    """Read the pixels first and keep the lanes that are nearer; all read before any writes."""
    count, size = transactions(lanes.address, hits, word_bytes, simt.coalescing)
    row[FreePipeEvent.READS] += 1
    row[FreePipeEvent.LOAD_TRANSACTIONS] += count
    row[FreePipeEvent.LOAD_BYTES] += size
    kept = 0
    for i in range(hits):
        value = lanes.value[i] + np.uint64(t0)
        if frame[lanes.address[i] // word_bytes] > value:
            lanes.address[kept], lanes.value[kept] = lanes.address[i], value
            kept += 1
    for i in range(kept):
        pixel = lanes.address[i] // word_bytes
        frame[pixel] = min(frame[pixel], lanes.value[i])
    return kept


@kernel(lent=True)
def _slot(seen: Any, most: Any, key: int) -> int:
    """Place of a key in a hash table; a new one begins with 0."""
    i = key & (SLOTS - 1)
    while seen[i] != key:
        if seen[i] < 0:
            seen[i], most[i] = key, 0
        else:
            i = (i + 1) & (SLOTS - 1)
    return i


@kernel(lent=True)
def _count_atomics(lanes: Lanes, hits: int, shape: FrameShape, merge: int, row: Any, chunks: Any) -> None:
    """One instruction on each plane of the frame buffer, by the rules of ``tilestamp.models.atomics``.

    A lane's rank is its place among those at its address; merged by sector, a request carries the lanes of one rank.
    """
    conflicts, depth, requests = 0, 0, 0
    shift = 3 if shape.word_bytes == WIDE else 2
    for i in range(hits):
        pixel = _slot(lanes.seen[0], lanes.most[0], lanes.address[i] >> shift)
        chunk = _slot(lanes.seen[1], lanes.most[1], lanes.address[i] // CHUNK_BYTES)
        rank, served = lanes.most[0, pixel] + 1, lanes.most[1, chunk]
        lanes.most[0, pixel], lanes.most[1, chunk] = rank, max(rank, served)
        lanes.slot[i, 0], lanes.slot[i, 1] = pixel, chunk
        conflicts += rank > 1
        depth = max(depth, rank)
        if merge != SECTOR or rank > served:
            requests += 1
            for plane in range(shape.words):
                chunks[(lanes.address[i] + plane * shape.plane_bytes) // CHUNK_BYTES] += 1
    for i in range(hits):
        lanes.seen[0, lanes.slot[i, 0]] = lanes.seen[1, lanes.slot[i, 1]] = -1
    row[FreePipeEvent.ATOMIC] += shape.words
    row[FreePipeEvent.ATOMIC_LANES] += shape.words * hits
    row[FreePipeEvent.ATOMIC_REQUESTS] += shape.words * requests
    row[FreePipeEvent.ATOMIC_CONFLICTS] += shape.words * conflicts
    row[FreePipeEvent.ATOMIC_DEPTH] += shape.words * depth


@kernel(lent=True)
def _scan(
    pieces: Pieces, lanes: Lanes, t0: int, shape: FrameShape, simt: Simt, row: Any, chunks: Any, frame: Any
) -> tuple[int, int, int]:
    """Scan the lanes' pieces in lockstep; returns the steps, the rows, and the steps that hit."""
    active, boxes, rows = _start_rows(pieces, lanes)
    steps, hit_steps = 0, 0
    row[FreePipeEvent.SETUP_STEPS] += 1
    row[FreePipeEvent.BOX_STEPS] += rows > 0
    row[FreePipeEvent.BOX_LANES] += boxes
    row[FreePipeEvent.SETUP_LANES] += active
    for r in range(rows):
        active, rest, turns = _start_row(pieces, lanes, r, shape.width, shape.unroll)
        here = rest + turns * shape.unroll
        row[FreePipeEvent.ROW_STEPS] += 1
        row[FreePipeEvent.ROW_LANES] += active
        row[FreePipeEvent.WARP_STEPS] += here
        row[FreePipeEvent.REST_STEPS] += rest
        steps += here
        for c in range(here):
            active, tests, hits = _step(pieces, lanes, active, c, rest, shape.word_bytes, frame is not None)
            row[FreePipeEvent.SAMPLE_TESTS] += tests
            hit_steps += hits > 0
            row[FreePipeEvent.SAMPLE_HITS] += hits
            if frame is not None and hits > 0:
                hits = _early(lanes, hits, t0, frame, shape.word_bytes, simt, row)
            if hits > 0:
                _count_atomics(lanes, hits, shape, simt.atomic_merge, row, chunks)
    return steps, rows, hit_steps


@kernel(lent=True)
def _warp(
    triangles: Any,
    pieces: Pieces,
    t0: int,
    lanes_in: int,
    shape: FrameShape,
    simt: Simt,
    lanes: Lanes,
    row: Any,
    chunks: Any,
    frame: Any,
) -> tuple[int, int, int]:
    """One warp, triangles t0..t0+lanes_in-1; returns its steps, its rows, and its steps that hit."""
    row[FreePipeEvent.WARPS] += 1
    row[FreePipeEvent.LANES_IN] += lanes_in
    _count_vertices(triangles, t0, lanes_in, simt, lanes.address, row)
    inside, clip, turns = 0, 0, 0
    lanes.piece[:] = -1
    for lane in range(lanes_in):
        t = t0 + lane
        if pieces.kind[t] == INSIDE:
            inside += 1
            lanes.piece[lane] = pieces.first[t]
        elif pieces.kind[t] == CLIPPED:
            clip += 1
            turns = max(turns, pieces.first[t + 1] - pieces.first[t])
    row[FreePipeEvent.CLIP_WARPS] += clip > 0
    row[FreePipeEvent.CLIP_LANES] += clip
    steps, rows, hit_steps = 0, 0, 0
    if inside > 0:
        steps, rows, hit_steps = _scan(pieces, lanes, t0, shape, simt, row, chunks, frame)
    for i in range(turns):
        for lane in range(WARP):
            t = t0 + lane
            mine = lane < lanes_in and pieces.kind[t] == CLIPPED and pieces.first[t] + i < pieces.first[t + 1]
            lanes.piece[lane] = pieces.first[t] + i if mine else -1
        more = _scan(pieces, lanes, t0, shape, simt, row, chunks, frame)
        steps, rows, hit_steps = steps + more[0], rows + more[1], hit_steps + more[2]
        row[FreePipeEvent.CLIP_HITS] += more[2]
    return steps, rows, hit_steps


@kernel
def draw_blocks(
    part: int,
    parts: int,
    triangles: Any,
    pieces: Pieces,
    block: int,
    shape: FrameShape,
    simt: Simt,
    table: Any,
    chunks: Any,
    frame: Any,
) -> None:
    """Every ``parts``-th block from ``part`` on, with its own rows of ``table`` and its part's of ``chunks``."""
    lanes = new_lanes()
    for b in range(part, table.shape[0], parts):
        longest = 0
        for t0 in range(b * block, min((b + 1) * block, triangles.shape[0]), WARP):
            lanes_in = min(WARP, min((b + 1) * block, triangles.shape[0]) - t0)
            steps, rows, hit_steps = _warp(
                triangles, pieces, t0, lanes_in, shape, simt, lanes, table[b], chunks[part], frame
            )
            if steps > longest:
                longest = steps
                table[b, FreePipeEvent.CHAIN_STEPS] = steps
                table[b, FreePipeEvent.CHAIN_ROWS] = rows
                table[b, FreePipeEvent.CHAIN_HITS] = hit_steps
