"""``antialias``: silhouette edges between neighbouring pixels blend their colours by where the edge crosses.

Laine et al. 2020, "Modular primitives for high-performance differentiable rendering", section 3.5. Two neighbours that
show different triangles look at the nearer one: where an edge of it that is a silhouette crosses the line between
their centres, the pixel that it covers in part takes some of the other's colour.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.nvdiffrast.arrays import Array, as_array, as_triangles, need_axis, same_batch
from tilestamp.simulator.nvdiffrast.topology import TopologyHash, antialias_construct_topology_hash
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.exact import fma

SLACK = np.float32(1 / 16)  # pixels that a crossing may lie outside of the line between two centres
_PART_ROWS = 8  # at least
_NONE, _HALF, _ONE, _NEVER = np.float32(0), np.float32(0.5), np.float32(1), np.float32(-3.4028235e38)


@kernel(error_model="numpy", lent=True)
def _cross(a: Any, b: Any, c: Any, d: Any) -> Any:
    return fma(a, b, -(c * d))


@kernel(error_model="numpy", lent=True)
def _same_sign(a: Any, b: Any) -> Any:
    """Whether two numbers have the same sign bit; NaN has none, as on the GPU."""
    return (np.signbit(a) and not np.isnan(a)) == (np.signbit(b) and not np.isnan(b))


@kernel(error_model="numpy", lent=True)
def _on_screen(p: Any, half_x: Any, half_y: Any, x: Any, y: Any) -> Any:
    """Place of a clip position, in pixels from (x, y)."""
    inverse = _ONE / p[3]
    return fma(p[0] * inverse, half_x, -x), fma(p[1] * inverse, half_y, -y)


@kernel(error_model="numpy", lent=True)
def _greater(n: Any, m: Any, d: Any, e: Any) -> Any:
    """Whether n / d > m / e."""
    return (n * e > m * d) == _same_sign(d, e)


@kernel(error_model="numpy", lent=True)
def _crossing(a: Any, b: Any, c: Any, kept: Any, sign: Any) -> Any:
    """Where the silhouette edge that is farthest along crosses the line to the neighbour, in pixels; -inf for none.

    Corners are places as seen from the pixel, first along the line; ``kept`` says of the edge across from each corner
    whether it is a silhouette.
    """
    e0, e1, e2 = (c[0] - b[0], c[1] - b[1]), (a[0] - c[0], a[1] - c[1]), (b[0] - a[0], b[1] - a[1])
    n0, n1, n2 = (
        sign * _cross(b[0], e0[1], b[1], e0[0]),
        sign * _cross(c[0], e1[1], c[1], e1[0]),
        sign * _cross(a[0], e2[1], a[1], e2[0]),
    )
    d0, d1, d2 = e0[1], e1[1], e2[1]
    if _same_sign(b[1], c[1]):
        n0, d0 = _NEVER, _ONE
    if _same_sign(c[1], a[1]):
        n1, d1 = _NEVER, _ONE
    if _same_sign(a[1], b[1]):
        n2, d2 = _NEVER, _ONE
    if _greater(n2, n0, d2, d0) and _greater(n2, n1, d2, d1):
        return n2 / d2 if kept[2] and abs(d2) >= abs(e2[0]) else _NEVER
    if _greater(n1, n0, d1, d0):
        return n1 / d1 if kept[1] and abs(d1) >= abs(e1[0]) else _NEVER
    return n0 / d0 if kept[0] and abs(d0) >= abs(e0[0]) else _NEVER


@kernel(error_model="numpy", lent=True)
def _share(rast: Any, pos: Any, tri: Any, opposite: Any, j: int, i: int, down: int, along: int) -> Any:
    """Share of the other's colour that one of two neighbours takes: positive the first, negative the second."""
    height, width = rast.shape[:2]
    near, far = rast[j, i], rast[j + down, i + along]
    one, other = int(near[3]) - 1, int(far[3]) - 1
    if one == other:
        return _NONE
    first = one >= 0 and (other < 0 or near[2] < far[2])
    t = one if first else other
    if not 0 <= t < len(tri):
        return _NONE
    x, y = (i, j) if first else (i + along, j + down)
    corners = tri[t]
    if min(corners[0], corners[1], corners[2]) < 0 or max(corners[0], corners[1], corners[2]) >= len(pos):
        return _NONE
    half_x, half_y = np.float32(width) * _HALF, np.float32(height) * _HALF
    fx, fy = np.float32(x) + _HALF - half_x, np.float32(y) + _HALF - half_y
    places = (
        _on_screen(pos[corners[0]], half_x, half_y, fx, fy),
        _on_screen(pos[corners[1]], half_x, half_y, fx, fy),
        _on_screen(pos[corners[2]], half_x, half_y, fx, fy),
    )
    kept = _silhouettes(places, pos, opposite[t], half_x, half_y, fx, fy)
    if not (kept[0] or kept[1] or kept[2]):
        return _NONE
    a, b, c = places
    if down:
        a, b, c = (a[1], a[0]), (b[1], b[0]), (c[1], c[0])
    sign = _ONE if first else -_ONE
    at = _crossing(a, b, c, kept, sign)
    if not -SLACK < at < _ONE + SLACK:
        return _NONE
    return sign * (_HALF - min(max(at, _NONE), _ONE))


@kernel(error_model="numpy", lent=True)
def _silhouettes(places: Any, pos: Any, opposite: Any, half_x: Any, half_y: Any, fx: Any, fy: Any) -> Any:
    """Of each edge, whether the triangle across lies on the same side of it, or is none."""
    a, b, c = places
    area = _cross(b[0] - a[0], c[1] - a[1], c[0] - a[0], b[1] - a[1])
    o0, o1, o2 = a, b, c
    if 0 <= opposite[0] < len(pos):
        o0 = _on_screen(pos[opposite[0]], half_x, half_y, fx, fy)
    if 0 <= opposite[1] < len(pos):
        o1 = _on_screen(pos[opposite[1]], half_x, half_y, fx, fy)
    if 0 <= opposite[2] < len(pos):
        o2 = _on_screen(pos[opposite[2]], half_x, half_y, fx, fy)
    return (
        _same_sign(_cross(b[0] - o0[0], c[1] - o0[1], c[0] - o0[0], b[1] - o0[1]), area),
        _same_sign(_cross(c[0] - o1[0], a[1] - o1[1], a[0] - o1[0], c[1] - o1[1]), area),
        _same_sign(_cross(a[0] - o2[0], b[1] - o2[1], b[0] - o2[0], a[1] - o2[1]), area),
    )


@kernel(error_model="numpy")
def _shares_part(part: int, parts: int, rast: Any, pos: Any, tri: Any, opposite: Any, shares: Any) -> None:
    """Take a share of the rows: of each pixel its shares with the neighbours right and above."""
    height, width = rast.shape[:2]
    for j in range(height * part // parts, height * (part + 1) // parts):
        for i in range(width):
            shares[j, i, 0] = _share(rast, pos, tri, opposite, j, i, 0, 1) if i + 1 < width else _NONE
            shares[j, i, 1] = _share(rast, pos, tri, opposite, j, i, 1, 0) if j + 1 < height else _NONE


@kernel(error_model="numpy", lent=True)
def _blend(share: Any, mine: Any, other: Any, out: Any) -> None:
    for c in range(len(out)):
        out[c] += share * (other[c] - mine[c])


@kernel(error_model="numpy")
def _blend_part(part: int, parts: int, color: Any, shares: Any, out: Any) -> None:
    """Take a share of the rows: each pixel adds what it takes from its neighbours right, above, left, below."""
    height, width = color.shape[:2]
    for j in range(height * part // parts, height * (part + 1) // parts):
        for i in range(width):
            if shares[j, i, 0] > _NONE:
                _blend(shares[j, i, 0], color[j, i], color[j, i + 1], out[j, i])
            if shares[j, i, 1] > _NONE:
                _blend(shares[j, i, 1], color[j, i], color[j + 1, i], out[j, i])
            if i > 0 and shares[j, i - 1, 0] < _NONE:
                _blend(-shares[j, i - 1, 0], color[j, i], color[j, i - 1], out[j, i])
            if j > 0 and shares[j - 1, i, 1] < _NONE:
                _blend(-shares[j - 1, i, 1], color[j, i], color[j - 1, i], out[j, i])


def antialias(
    color: Array, rast: Array, pos: Array, tri: Array, topology_hash: TopologyHash | None = None
) -> NDArray[np.float32]:
    """Antialias silhouettes as ``nvdiffrast.torch.antialias`` does.

    Parameters
    ----------
    color : array, (B, H, W, C), float32
    rast : array, (B, H, W, 4), float32
        From ``rasterize``.
    pos : array, (B, V, 4) or (V, 4), float32
        As given to ``rasterize``.
    tri : array, (F, 3), int32
    topology_hash : TopologyHash, optional
        From ``antialias_construct_topology_hash``.

    Returns
    -------
    ndarray, (B, H, W, C), float32
        To the bit where a pixel takes from one neighbour; where it takes from several the original adds in any order.

    Raises
    ------
    TilestampError
        For other shapes and types.
    """
    color = as_array("color", color, np.float32, "[B, H, W, C]", 4)
    rast = as_array("rast", rast, np.float32, "[B, H, W, 4]", 4)
    need_axis("rast", rast, 3, 4, "[B, H, W, 4]")
    pos = as_array("pos", pos, np.float32, "[B, V, 4] or [V, 4]", 2, 3)
    need_axis("pos", pos, -1, 4, "[B, V, 4] or [V, 4]")
    tri = as_triangles(tri)
    if color.shape[1:3] != rast.shape[1:3]:
        raise TilestampError(f"color {list(color.shape)} and rast {list(rast.shape)} have different sizes")
    same_batch(len(color), len(rast), "color and rast")
    if pos.ndim == 3:
        same_batch(len(pos), len(rast), "pos and rast")
    if topology_hash is None:
        topology_hash = antialias_construct_topology_hash(tri)
    if not isinstance(topology_hash, TopologyHash) or topology_hash.opposite.shape != tri.shape:
        raise TilestampError("topology_hash must come from antialias_construct_topology_hash with the same tri")
    out: NDArray[np.float32] = color.copy()
    parts = parts_of(color.shape[1], _PART_ROWS)
    shares = np.empty((*color.shape[1:3], 2), np.float32)
    with np.errstate(all="ignore"):
        for b in range(len(color)):
            positions = pos if pos.ndim == 2 else pos[b]
            for_parts(_shares_part, parts, rast[b], positions, tri, topology_hash.opposite, shares)
            for_parts(_blend_part, parts, color[b], shares, out[b])
    return out
