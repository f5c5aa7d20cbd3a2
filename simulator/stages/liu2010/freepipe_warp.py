"""FreePipe, one warp: lanes in lockstep, as long as the largest triangle among them (Liu et al. 2010).

A thread scans its triangle's box in two nested loops. Lanes come together again after each row, so a warp runs, for
each row that any lane still has, as many steps as the widest box among those lanes. Lanes whose triangle needs no
clipping go first; then the others scan the triangles of their clipped polygons, one after another.
"""

from typing import Any

import numpy as np

from tilestamp.models.atomics import SECTOR
from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_lanes import SLOTS, WARP, FrameShape, Lanes, new_lanes
from tilestamp.simulator.stages.liu2010.freepipe_rows import (
    cover_row,
    find_steps,
    hit_lanes,
    longest,
    start_lanes,
    take_boxes,
)
from tilestamp.simulator.stages.liu2010.freepipe_triangle import (
    CLIPPED,
    INSIDE,
    Pieces,
    fixed_depth,
)

INDEX_BYTES = 4
POSITION_BYTES = 16
WIDE = 8  # bytes of a fragment in one word


@kernel(lent=True)
def _count_vertices(triangles: Any, t0: int, lanes: int, simt: Simt, indices: Any, address: Any, row: Any) -> None:
    """Count loads of three indices, known for a full warp, and of three positions a lane."""
    count, size = indices if lanes == WARP else _index_loads(lanes, simt, address)
    mine = triangles[t0 : t0 + lanes]
    for k in range(3):
        for lane in range(lanes):
            address[lane] = np.int64(mine[lane, k]) * POSITION_BYTES
        more, more_size = transactions(address, lanes, POSITION_BYTES, simt.coalescing)
        count, size = count + more, size + more_size
    row[FreePipeEvent.LOAD_TRANSACTIONS] += count
    row[FreePipeEvent.LOAD_BYTES] += size


@kernel(lent=True)
def _index_loads(lanes: int, simt: Simt, address: Any) -> tuple[int, int]:
    """Transactions and bytes of the loads of three indices a lane; all warps begin at a multiple of 128 bytes."""
    count, size = 0, 0
    for k in range(3):
        for lane in range(lanes):
            address[lane] = (3 * lane + k) * INDEX_BYTES
        more, more_size = transactions(address, lanes, INDEX_BYTES, simt.coalescing)
        count, size = count + more, size + more_size
    return count, size


@kernel(lent=True)
def _start_depths(pieces: Pieces, lanes: Lanes, r: int) -> None:
    """Depths of row r at the lanes' first pixels; then step up to the next row."""
    for lane in range(WARP):
        if r < lanes.box[2 * WARP + lane]:
            p = lanes.piece[lane]
            depth = pieces.depth[p, 0] if r == 0 else lanes.depth[0, lane]
            lanes.depth[1, lane], lanes.column[lane] = depth, 0
            lanes.depth[0, lane] = depth + pieces.depth[p, 2] * np.float32(16)


@kernel(lent=True)
def _depth_at(pieces: Pieces, lanes: Lanes, lane: int, column: int) -> Any:
    """Depth of a lane at a column, reached step by step as a thread does."""
    while lanes.column[lane] < column:
        lanes.depth[1, lane] += pieces.depth[lanes.piece[lane], 1] * np.float32(16)
        lanes.column[lane] += 1
    return lanes.depth[1, lane]


@kernel(lent=True)
def _early(pieces: Pieces, lanes: Lanes, bits: Any, c: int, t0: int, frame: Any, simt: Simt, row: Any) -> Any:
    """Read the pixels first and keep the lanes that are nearer; all read before any writes."""
    hits, kept, left = 0, np.uint64(0), bits
    while left != np.uint64(0):
        lane = lowest_bit(left)
        left &= left - np.uint64(1)
        pixel = lanes.here[lane] + c
        lanes.address[hits] = pixel * WIDE
        hits += 1
        depth = fixed_depth(_depth_at(pieces, lanes, lane, pixel - lanes.first[lane]))
        lanes.value[lane] = np.uint64(depth << 32) | np.uint64(t0 + lane + 1)
        if frame[pixel] > lanes.value[lane]:
            kept |= np.uint64(1) << np.uint64(lane)
    count, size = transactions(lanes.address, hits, WIDE, simt.coalescing)
    row[FreePipeEvent.READS] += 1
    row[FreePipeEvent.LOAD_TRANSACTIONS] += count
    row[FreePipeEvent.LOAD_BYTES] += size
    left = kept
    while left != np.uint64(0):
        lane = lowest_bit(left)
        left &= left - np.uint64(1)
        pixel = lanes.here[lane] + c
        frame[pixel] = min(frame[pixel], lanes.value[lane])
    return kept


@kernel(lent=True)
def _most_lanes(ranks: Any) -> int:
    """Lanes at the most wanted word of a chunk so far."""
    most = 0
    for byte in range(0, 64, 8):
        most = max(most, int((ranks >> np.uint64(byte)) & np.uint64(255)))
    return most


@kernel(lent=True)
def _send(lanes: Lanes, bits: Any, c: int, chunk_bits: int, merge: int, chunks: Any) -> tuple[int, int, int]:
    """Count requests, conflicts and depth of one atomic instruction, by the rules of ``tilestamp.models.atomics``.

    A lane's rank is its place among those at its address; merged by sector, a request carries the lanes of one rank.
    """
    conflicts, depth, requests = 0, 1, 0
    seen, ranks, here = lanes.seen, lanes.ranks, lanes.here
    seen[SLOTS] += 1
    number = seen[SLOTS] << 32
    while bits != np.uint64(0):
        pixel = here[lowest_bit(bits)] + c
        bits &= bits - np.uint64(1)
        chunk = pixel >> chunk_bits
        word = np.uint64(1) << np.uint64(8 * (pixel - (chunk << chunk_bits)))
        key = number | chunk
        slot = np.uint64(chunk & (SLOTS - 1))
        while seen[slot] != key and seen[slot] >= number:
            slot = (slot + np.uint64(1)) & np.uint64(SLOTS - 1)
        sent = merge != SECTOR
        if seen[slot] != key:
            seen[slot], ranks[slot] = key, word
            sent = True
        else:
            before = ranks[slot]
            ranks[slot] = before + word
            rank = int(before // word & np.uint64(255)) + 1
            if rank > 1:
                conflicts += 1
                depth = max(depth, rank)
                sent |= rank > _most_lanes(before)
        if sent:
            requests += 1
            chunks[np.uint64(chunk)] += 1
    return requests, conflicts, depth


@kernel(lent=True)
def _loop(
    pieces: Pieces, lanes: Lanes, steps: int, t0: int, shape: FrameShape, simt: Simt, row: Any, chunks: Any, frame: Any
) -> int:
    """Play the steps of a loop over a row's pixels; returns those that hit."""
    hit_steps, hits, sends, lanes_sent, requests, conflicts, depth = 0, 0, 0, 0, 0, 0, 0
    for c in range(steps):
        bits = hit_lanes(lanes.step, c)
        if bits == np.uint64(0):
            continue
        hit_steps += 1
        hits += popcount(bits)
        if frame is not None:
            bits = _early(pieces, lanes, bits, c, t0, frame, simt, row)
            if bits == np.uint64(0):
                continue
        sent = _send(lanes, bits, c, 2 if shape.word_bytes == WIDE else 3, simt.atomic_merge, chunks)
        sends, lanes_sent = sends + 1, lanes_sent + popcount(bits)
        requests, conflicts, depth = requests + sent[0], conflicts + sent[1], depth + sent[2]
    row[FreePipeEvent.SAMPLE_HITS] += hits
    row[FreePipeEvent.ATOMIC] += shape.words * sends
    row[FreePipeEvent.ATOMIC_LANES] += shape.words * lanes_sent
    row[FreePipeEvent.ATOMIC_REQUESTS] += shape.words * requests
    row[FreePipeEvent.ATOMIC_CONFLICTS] += shape.words * conflicts
    row[FreePipeEvent.ATOMIC_DEPTH] += shape.words * depth
    return hit_steps


@kernel(lent=True)
def _scan(
    pieces: Pieces, lanes: Lanes, t0: int, shape: FrameShape, simt: Simt, row: Any, chunks: Any, frame: Any
) -> tuple[int, int, int]:
    """Scan the lanes' pieces in lockstep; returns the steps, the rows, and the steps that hit."""
    rows = take_boxes(pieces, lanes, shape, row)
    start_lanes(lanes, shape.width)
    steps, hit_steps, rest_steps = 0, 0, 0
    for r in range(rows):
        rest, turns = longest(lanes.box, r)
        rest_steps += rest
        steps += rest + (turns << shape.unroll_log2)
        cover_row(lanes.edge, lanes.box, lanes.span, r)
        if frame is not None:
            _start_depths(pieces, lanes, r)
        if rest > 0:
            find_steps(lanes, False)
            hit_steps += _loop(pieces, lanes, rest, t0, shape, simt, row, chunks, frame)
        if turns > 0:
            find_steps(lanes, True)
            hit_steps += _loop(pieces, lanes, turns << shape.unroll_log2, t0, shape, simt, row, chunks, frame)
        for lane in range(WARP):
            lanes.first[lane] += shape.width
    row[FreePipeEvent.WARP_STEPS] += steps
    row[FreePipeEvent.REST_STEPS] += rest_steps
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
    indices: Any,
    row: Any,
    chunks: Any,
    frame: Any,
) -> tuple[int, int, int]:
    """One warp, triangles t0..t0+lanes_in-1; returns its steps, its rows, and its steps that hit."""
    row[FreePipeEvent.WARPS] += 1
    row[FreePipeEvent.LANES_IN] += lanes_in
    _count_vertices(triangles, t0, lanes_in, simt, indices, lanes.address, row)
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
    indices = _index_loads(WARP, simt, lanes.address)
    for b in range(part, table.shape[0], parts):
        longest = 0
        for t0 in range(b * block, min((b + 1) * block, triangles.shape[0]), WARP):
            lanes_in = min(WARP, min((b + 1) * block, triangles.shape[0]) - t0)
            steps, rows, hit_steps = _warp(
                triangles, pieces, t0, lanes_in, shape, simt, lanes, indices, table[b], chunks[part], frame
            )
            if steps > longest:
                longest = steps
                table[b, FreePipeEvent.CHAIN_STEPS] = steps
                table[b, FreePipeEvent.CHAIN_ROWS] = rows
                table[b, FreePipeEvent.CHAIN_HITS] = hit_steps
