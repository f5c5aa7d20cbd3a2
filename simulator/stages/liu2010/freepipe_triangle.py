"""FreePipe, one thread's triangles: clip, project, snap, and the plane of its depth (Liu et al. 2010).

The arithmetic is that of the H200 kernel that was measured: 28.4 fixed point, cudaraster's fill rule, and clipping
of whole vertices in clip space, so that coverage can be compared with cudaraster's. Depth is float32 in the order of
operations of the source; a compiler that contracts differently moves its last bits.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.exact import fma, round_to_int32

NOTHING, INSIDE, CLIPPED = 0, 1, 2  # what a thread does with its triangle
PLANES = 6
SUBPIXEL_BITS = 4
MAX_POLYGON = 10
FARTHEST = 1 << 24  # sub-pixels from the centre, beyond all bands; edge functions stay below 2**53, exact in float64
_PART_TRIANGLES = 4096  # at least
_F0, _F1 = np.float32(0), np.float32(1)
Band = tuple[np.float32, np.float32]
SCREEN: Band = (_F1, _F1)  # the screen's own borders


class Pieces(NamedTuple):
    """Triangles to scan: a thread has one, or the fan of its clipped polygon."""

    kind: NDArray[np.uint8]  # (F,) NOTHING, INSIDE or CLIPPED
    first: NDArray[np.int64]  # (F + 1,) first piece of each input triangle
    corner: NDArray[np.int32]  # (P, 6) x0 y0 x1 y1 x2 y2, sub-pixels from the lower-left, counter-clockwise
    box: NDArray[np.int32]  # (P, 4) first and last pixel column, first and last row; empty where last < first
    facing: NDArray[np.int8]  # (P,) 1 counter-clockwise as it came, -1 clockwise, 0 without area
    depth: NDArray[np.float32]  # (P, 3) NDC depth at the first pixel's centre, its slopes a sub-pixel in x and y


@kernel(lent=True)
def _distance(p: Any, plane: int, band: Any) -> Any:
    """Signed distance to a clip plane, in the order +x -x +y -y +z -z; x and y as far out as the band's half sides."""
    axis = plane // 2
    w = p[3] if axis == 2 else p[3] * band[axis]
    return w + p[axis] if plane % 2 == 0 else w - p[axis]


@kernel(lent=True)
def _is_inside(p: Any, band: Any) -> bool:
    if not p[3] >= _F0:
        return False
    for axis in range(3):
        w = p[3] if axis == 2 else p[3] * band[axis]
        if abs(p[axis]) > w:  # a NaN is ignored
            return False
    return True


@kernel(lent=True)
def _copy(source: Any, target: Any) -> None:
    """Copy a position; an assignment of slices would compile five seconds longer."""
    for c in range(4):
        target[c] = source[c]


@kernel(error_model="numpy", lent=True)
def _clip(polygon: Any, spare: Any, band: Any) -> int:
    """Clip a triangle by all six planes in turn; returns the polygon's vertices."""
    n = 3
    for plane in range(PLANES):
        if n < 3:
            break
        kept = 0
        a = n - 1
        a_far = _distance(polygon[a], plane, band)
        for b in range(n):
            b_far = _distance(polygon[b], plane, band)
            if a_far * b_far < _F0:
                s = a_far / (a_far - b_far)
                for c in range(4):
                    spare[kept, c] = fma(polygon[b, c] - polygon[a, c], s, polygon[a, c])
                kept += 1
            if b_far >= _F0:
                _copy(polygon[b], spare[kept])
                kept += 1
            a, a_far = b, b_far
        n = kept
        for i in range(n):
            _copy(spare[i], polygon[i])
    return n


@kernel(lent=True)
def _classify(polygon: Any, spare: Any, band: Any) -> tuple[int, int]:
    """Clip in place; returns what the thread does and how many pieces it scans."""
    if _is_inside(polygon[0], band) and _is_inside(polygon[1], band) and _is_inside(polygon[2], band):
        return INSIDE, 1
    for plane in range(PLANES):
        if (
            _distance(polygon[0], plane, SCREEN) < _F0
            and _distance(polygon[1], plane, SCREEN) < _F0
            and _distance(polygon[2], plane, SCREEN) < _F0
        ):
            return NOTHING, 0
    return CLIPPED, max(_clip(polygon, spare, band) - 2, 0)


@kernel(lent=True)
def _pixels(a: int, b: int, c: int, bits: int, size: int) -> tuple[int, int]:
    """First and last pixel whose centre lies between the least and the largest of three coordinates."""
    half = 1 << (bits - 1)
    return max((min(a, b, c) + half - 1) >> bits, 0), min((max(a, b, c) - half) >> bits, size - 1)


@kernel(error_model="numpy", lent=True)
def _project(vertex: Any, width: int, height: int, bits: int, place: Any) -> Any:
    """Project a clip position and snap it to ``place``, sub-pixels; returns its depth.

    Where w is so near 0 that its inverse is infinite, a vertex inside of the band can come out beyond ``FARTHEST``.
    """
    half = 1 << (bits - 1)
    r = _F1 / vertex[3]
    x = round_to_int32(vertex[0] * r * np.float32(half * width))
    y = round_to_int32(vertex[1] * r * np.float32(half * height))
    place[0] = min(max(x, -FARTHEST), FARTHEST) + half * width
    place[1] = min(max(y, -FARTHEST), FARTHEST) + half * height
    return vertex[2] * r


@kernel(error_model="numpy", lent=True, inline=True)
def _piece(places: Any, depths: Any, i: int, j: int, k: int, size: Any, bits: int, pieces: Any, p: int) -> None:
    """Find box and depth plane of the triangle of three projected vertices, and which way it faces."""
    half = 1 << (bits - 1)
    corner, box, depth = pieces.corner[p], pieces.box[p], pieces.depth[p]
    x0, y0, x1, y1, x2, y2 = places[i, 0], places[i, 1], places[j, 0], places[j, 1], places[k, 0], places[k, 1]
    z0, z1, z2 = depths[i], depths[j], depths[k]
    corner[0], corner[1], corner[2], corner[3], corner[4], corner[5] = x0, y0, x1, y1, x2, y2
    depth[0], depth[1], depth[2] = z0, z1, z2
    area = (np.int64(x1) - x0) * (np.int64(y2) - y0) - (np.int64(y1) - y0) * (np.int64(x2) - x0)
    box[0], box[1], box[2], box[3] = 0, -1, 0, -1
    pieces.facing[p] = int(area > 0) - int(area < 0)
    if area == 0:
        return
    if area < 0:
        x1, y1, z1, x2, y2, z2 = x2, y2, z2, x1, y1, z1
        corner[2], corner[3], corner[4], corner[5] = x1, y1, x2, y2
        area = -area
    box[0], box[1] = _pixels(x0, x1, x2, bits, size[0])
    box[2], box[3] = _pixels(y0, y1, y2, bits, size[1])
    r = _F1 / np.float32(area)
    dx0, dy0, dx2, dy2 = np.float32(x1 - x0), np.float32(y1 - y0), np.float32(x0 - x2), np.float32(y0 - y2)
    slope_x = (-((z2 - z0) * dy0) + (z1 - z0) * -dy2) * r
    slope_y = ((z2 - z0) * dx0 + (z1 - z0) * dx2) * r
    to_x, to_y = np.float32((box[0] << bits) + half - x0), np.float32((box[2] << bits) + half - y0)
    depth[0], depth[1], depth[2] = z0 + slope_x * to_x + slope_y * to_y, slope_x, slope_y


@kernel(lent=True)
def _fetch(positions: Any, triangles: Any, t: int, polygon: Any) -> None:
    for k in range(3):
        _copy(positions[triangles[t, k]], polygon[k])


@kernel
def _classify_part(part: int, parts: int, positions: Any, triangles: Any, band: Any, kind: Any, count: Any) -> None:
    polygon, spare = np.empty((MAX_POLYGON, 4), np.float32), np.empty((MAX_POLYGON, 4), np.float32)
    for t in range(kind.size * part // parts, kind.size * (part + 1) // parts):
        _fetch(positions, triangles, t, polygon)
        kind[t], count[t] = _classify(polygon, spare, band)


@kernel(lent=True)
def _vertex_part(part: int, parts: int, positions: Any, size: Any, bits: int, places: Any, depths: Any) -> None:
    """Project the vertices once: those that are clipped away come out as anything."""
    for v in range(depths.size * part // parts, depths.size * (part + 1) // parts):
        depths[v] = _project(positions[v], size[0], size[1], bits, places[v])


@kernel
def _piece_part(
    part: int, parts: int, positions: Any, triangles: Any, size: Any, bits: int, band: Any, places: Any, depths: Any,
    pieces: Pieces,
) -> None:  # fmt: skip
    """Make the pieces of a share of the triangles; corners of clipped ones are projected here."""
    polygon, spare = np.empty((MAX_POLYGON, 4), np.float32), np.empty((MAX_POLYGON, 4), np.float32)
    own_places, own_depths = np.empty((MAX_POLYGON, 2), np.int32), np.empty(MAX_POLYGON, np.float32)
    for t in range(pieces.kind.size * part // parts, pieces.kind.size * (part + 1) // parts):
        p = pieces.first[t]
        if pieces.kind[t] == INSIDE:
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            _piece(places, depths, np.int64(a), np.int64(b), np.int64(c), size, bits, pieces, p)
        elif pieces.kind[t] == CLIPPED:
            _fetch(positions, triangles, t, polygon)
            n = _clip(polygon, spare, band)
            for i in range(n):
                own_depths[i] = _project(polygon[i], size[0], size[1], bits, own_places[i])
            for i in range(n - 2):
                _piece(own_places, own_depths, np.int64(0), i + 1, i + 2, size, bits, pieces, p + i)


@kernel(lent=True)
def start_edges(corner: Any, bits: int, x: int, y: int, edge: Any) -> None:
    """Edge functions at the centre of pixel (x, y), less one where the edge does not own its points."""
    half = np.int64(1) << (bits - 1)
    center_x, center_y = (np.int64(x) << bits) + half, (np.int64(y) << bits) + half
    for k in range(3):
        j = 2 * ((k + 1) % 3)
        dx, dy = np.int64(corner[j]) - corner[2 * k], np.int64(corner[j + 1]) - corner[2 * k + 1]
        owns = dy < 0 or (dy == 0 and dx > 0)
        edge[k] = dx * (center_y - corner[2 * k + 1]) - dy * (center_x - corner[2 * k]) - (0 if owns else 1)
        edge[3 + 2 * k], edge[4 + 2 * k] = dx << bits, dy << bits


@kernel(lent=True)
def fixed_depth(z: Any) -> Any:
    """NDC depth to 32 bits of fixed point, 0 nearest."""
    unit = min(max(z * np.float32(0.5) + np.float32(0.5), _F0), _F1)
    if not unit >= _F0:  # NaN saturates to 0
        return np.int64(0)
    return np.int64(np.rint(np.float64(unit * np.float32(4294967040.0))))


def make_pieces(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    bits: int = SUBPIXEL_BITS,
    band: Band = SCREEN,
) -> Pieces:
    """Do every thread's work up to the scan.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Pixels.
    bits : int
        Sub-pixel bits of the snapped corners.
    band : tuple of float32
        Where triangles are clipped in x and y, in half sides of the screen.

    Raises
    ------
    TilestampError
        For an index out of range.
    """
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(positions)):
        raise TilestampError(f"a triangle names a vertex outside 0..{len(positions) - 1}")
    parts = parts_of(len(triangles), _PART_TRIANGLES)
    kind, count = np.empty(len(triangles), np.uint8), np.empty(len(triangles), np.uint8)
    for_parts(_classify_part, parts, positions, triangles, band, kind, count)
    first = np.zeros(len(triangles) + 1, np.int64)
    np.cumsum(count, out=first[1:])
    total = int(first[-1])
    corner, box = np.empty((total, 6), np.int32), np.empty((total, 4), np.int32)
    pieces = Pieces(kind, first, corner, box, np.empty(total, np.int8), np.empty((total, 3), np.float32))
    places, depths = np.empty((len(positions), 2), np.int32), np.empty(len(positions), np.float32)
    size = width, height
    for_parts(_vertex_part, parts_of(len(positions), _PART_TRIANGLES), positions, size, bits, places, depths)
    for_parts(_piece_part, parts, positions, triangles, size, bits, band, places, depths, pieces)
    return pieces
