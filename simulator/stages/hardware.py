"""Fixed function: what passes through the units of a hardware rasterizer, and the picture that it makes.

A GPU's own pipe takes primitives in order: it fetches and transforms vertices, culls, sets up, walks the 2x2 quads of
pixels that a triangle covers, tests depth before shading, and writes what is left. Each unit has a rate in the machine
file, and the slowest sets the time. The counts here are exact for the coverage rule of cudaraster (section 6) at
``bits`` sub-pixel bits (8, as hardware has) and for depth tests in input order. Triangles are clipped at the near and
the far plane and, in x and y, only at a guard band (16 bits of whole pixels: the range of Direct3D 11's viewports), so
that one that leaves the screen stays whole; quads count where they lie on the screen. A shared edge is cut for both of
its triangles or for neither: no cracks, where a test against a band and clipping at the screen leaves some
(experiment stability/guard_band). The depth plane is evaluated in float32
and kept in one of the formats of graphics interfaces: 16, 24 or 32 bits of fixed point, or float32.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.depth_format import DEPTHS, DepthFormat, stored_depth
from tilestamp.simulator.stages.liu2010.freepipe_triangle import SCREEN, Band, Pieces, make_pieces, start_edges
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import FixedFunctionWork

SUBPIXEL_BITS = 8
MAX_SIDE = 16384  # pixels, the limit of Direct3D 11 hardware
GUARD_BAND = 32767  # pixels: D3D11_VIEWPORT_BOUNDS_MAX; coordinates of 16.8 bits
STRIPS = 4  # of rows, drawn side by side
QUADS, Z_TESTS, WRITES = 0, 1, 2  # columns of a strip's counts
INDEX_BYTES, VERTEX_BYTES, COLOR_BYTES = 4, 32, 4


class HardwareFrame(NamedTuple):
    """What is left in the frame buffer; row 0 is the bottom row."""

    ids: NDArray[np.int32]  # (H, W) input triangle, -1 where there is none
    depth: NDArray[np.uint32]  # (H, W) units of the format, or bits of a float; the farthest where there is none


@kernel
def _quad(
    pieces: Pieces,
    p: int,
    t: int,
    edge: Any,
    x: int,
    y: int,
    corner: Any,
    rows: int,
    bits: int,
    scale: Any,
    ids: Any,
    depth: Any,
    counts: Any,
) -> None:
    """Test the four pixels of one quad, whose lower-left pixel is (x, y); draw those of the strip's rows."""
    tests = 0
    for j in range(2):
        for i in range(2):
            column, row = x + i, y + j
            if column >= ids.shape[1] or row >= rows:
                continue
            inside = True
            for k in range(3):
                inside &= edge[k] + j * edge[3 + 2 * k] - i * edge[4 + 2 * k] >= 0
            if not inside:
                continue
            tests += 1
            right, up = np.float32((column - corner[0]) << bits), np.float32((row - corner[2]) << bits)
            z = stored_depth(pieces.depth[p, 0] + pieces.depth[p, 1] * right + pieces.depth[p, 2] * up, scale)
            if z < depth[row, column]:
                depth[row, column], ids[row, column] = z, t
                counts[WRITES] += 1
    counts[QUADS] += tests > 0
    counts[Z_TESTS] += tests


@kernel
def _draw_strip(
    part: int, parts: int, pieces: Pieces, bits: int, scale: Any, cull: Any, ids: Any, depth: Any, counts: Any
) -> None:
    """Draw all triangles, in order, to the rows of a strip, which begins at an even one."""
    pairs = (ids.shape[0] + 1) // 2
    first_row, end_row = 2 * (pairs * part // parts), min(2 * (pairs * (part + 1) // parts), ids.shape[0])
    edge = np.empty(9, np.int64)
    for t in range(pieces.kind.size):
        for p in range(pieces.first[t], pieces.first[t + 1]):
            box = pieces.box[p]
            if box[1] < box[0] or box[3] < first_row or box[2] >= end_row or (cull and pieces.facing[p] < 0):
                continue
            left = np.int64(box[0]) & -2
            for y in range(max(np.int64(box[2]) & -2, first_row), min(np.int64(box[3]) + 1, end_row), 2):
                start_edges(pieces.corner[p], bits, left, y, edge)
                for x in range(left, np.int64(box[1]) + 1, 2):
                    _quad(pieces, p, t, edge, x, y, box, end_row, bits, scale, ids, depth, counts[part])
                    for k in range(3):
                        edge[k] -= 2 * edge[4 + 2 * k]


def hardware(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    *,
    cull_backfaces: bool = True,
    bits: int = SUBPIXEL_BITS,
    depth_format: DepthFormat = "fixed32",
    guard_band: bool = True,
) -> StageResult[HardwareFrame]:
    """Draw triangles in input order, and count what each unit sees.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Pixels.
    cull_backfaces : bool
        Leave out what is clockwise on the screen.
    bits : int
        Sub-pixel bits of the snapped corners, 4 to 8.
    depth_format : {"fixed16", "fixed24", "fixed32", "float32"}
        How depth is kept.
    guard_band : bool
        Clip in x and y only beyond ``GUARD_BAND`` pixels; False: at the screen's borders, and count each piece's quads.

    Returns
    -------
    outputs : HardwareFrame
    works : one FixedFunctionWork
        Items: ``vertices``, ``primitives`` in, ``culled`` (outside, turned away, without area or without a pixel
        centre in their box), ``quads`` touched, ``pixels`` shaded, ``z`` tests, ``samples`` written. Depth is tested
        before shading, so as many pixels are shaded as written.
    facts : dict
        ``rasterized``, ``quad_efficiency``: covered pixels by pixels of the quads touched.

    Raises
    ------
    TilestampError
        For a size that cannot be, or an index out of range.
    """
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise TilestampError(f"size {width}x{height}: hardware draws 1 to {MAX_SIDE} pixels in each direction")
    pieces = make_pieces(positions, triangles, width, height, bits, band_of(width, height) if guard_band else SCREEN)
    depths = DEPTHS[depth_format]
    ids, depth = np.full((height, width), -1, np.int32), np.full((height, width), depths.far, np.uint32)
    counts = np.zeros((STRIPS, 3), np.int64)
    for_parts(_draw_strip, STRIPS, pieces, bits, depths.scale, cull_backfaces, ids, depth, counts)
    quads, tests, writes = (int(n) for n in counts.sum(axis=0))
    work, rasterized = _work(positions, triangles, pieces, cull_backfaces, quads, tests, writes, depths.bytes)
    facts = {"rasterized": rasterized, "quad_efficiency": tests / max(4 * quads, 1)}
    works: Any = (work,)  # of fixed function
    return StageResult(HardwareFrame(ids, depth), works, facts)


def band_of(width: int, height: int) -> Band:
    """Half sides of the guard band about the screen's centre, in half sides of the screen."""
    across, along = ((GUARD_BAND - side / 2) / (side / 2) for side in (width, height))
    return np.float32(across), np.float32(along)


def hardware_grids(
    grids: NDArray[np.float32], width: int, height: int, *, bits: int = SUBPIXEL_BITS
) -> StageResult[HardwareFrame]:
    """Draw micropolygon grids, each quad as two triangles: the hybrid path.

    Parameters
    ----------
    grids : ndarray, (G, R, C, 4), float32
        Clip positions of grids of R x C vertices.
    width, height : int
        Pixels.
    bits : int
        Sub-pixel bits.

    Returns
    -------
    StageResult
        As of ``hardware``; ids count quads, in the order of grids, rows, columns.
    """
    count, rows, columns = grids.shape[:3]
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    pair = np.stack([np.stack([a, b, c], axis=-1), np.stack([c, b, d], axis=-1)], axis=2).reshape(-1, 3)
    triangles = (pair[None] + (np.arange(count) * rows * columns)[:, None, None]).reshape(-1, 3).astype(np.int32)
    positions = np.ascontiguousarray(grids.reshape(-1, 4))
    frame, works, facts = hardware(positions, triangles, width, height, cull_backfaces=False, bits=bits)
    return StageResult(frame._replace(ids=np.where(frame.ids >= 0, frame.ids // 2, -1).astype(np.int32)), works, facts)


def _work(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    pieces: Pieces,
    cull: bool,
    quads: int,
    tests: int,
    writes: int,
    depth_bytes: int,
) -> tuple[FixedFunctionWork, int]:
    """Items of the units and the buffers that they touch; returns the triangles that reach the rasterizer too."""
    drawn = (pieces.box[:, 1] >= pieces.box[:, 0]) & (pieces.box[:, 3] >= pieces.box[:, 2])
    if cull:
        drawn &= pieces.facing > 0
    parts = np.concatenate([[0], np.cumsum(drawn)])
    rasterized = int(np.count_nonzero(np.diff(parts[pieces.first])))
    items = {
        "vertices": len(positions),
        "primitives": len(triangles),
        "culled": len(triangles) - rasterized,
        "quads": quads,
        "pixels": writes,
        "z": tests,
        "samples": writes,
    }
    indices, vertices = triangles.size * INDEX_BYTES, len(positions) * VERTEX_BYTES
    streams = (
        Stream("triangles", "load", indices, indices),
        Stream("positions", "load", vertices, vertices),
        Stream("depth", "load", tests * depth_bytes, tests * depth_bytes),
        Stream("depth", "store", writes * depth_bytes, writes * depth_bytes),
        Stream("frame", "store", writes * COLOR_BYTES, writes * COLOR_BYTES),
    )
    events = {"RASTERIZED": rasterized, "SAMPLE_TESTS": 4 * quads, "SAMPLE_HITS": tests}
    work = FixedFunctionWork(
        stage="hardware", kernel="draw", items=items, events=events, streams=streams, counters=SAMPLE_COUNTERS
    )
    return work, rasterized
