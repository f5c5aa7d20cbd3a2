"""Tiles that a moving, defocused triangle may reach, and the samples of them: bounds over time and lens that hold.

A triangle stays off a tile over an interval of time and lens if all its corners stay beyond the plane through the eye
and one side of the tile. A corner's distance from that plane times w is linear in time and in the lens point, each for
itself, so that it is largest at a corner of the interval; and what lies between corners beyond a plane is beyond it,
also where some of them are behind the eye (Laine et al. 2011: no clipping). Near and far planes go likewise. Only which
tiles are looked at takes a division: the box of the corners' ends, their paths being straight; a triangle that reaches
the plane of the eye looks at all tiles.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.stochastic.triangles import MovingTriangles

MARGIN = 1.0 / 64.0  # pixels: covers the rounding of a test in float32
TINY = 2.0**-20  # of a coordinate: the same, where w is next to nothing
EVERYTHING = (0.0, 1.0, -1.0, 1.0, -1.0, 1.0)  # time, lens u, lens v


class Visits(NamedTuple):
    """Pairs of triangle and tile that were looked at, triangle by triangle.

    Parameters
    ----------
    starts : ndarray, (M + 1,), int64
        Where the visits of each triangle begin.
    tiles : ndarray, (visits,), int32
    masks : ndarray, (visits,), int64
        Bit s: the triangle may cover sample s of a pixel of the tile; 0: it stays off.
    bounds : ndarray, (visits,), int64
        Intervals that were looked at.
    """

    starts: NDArray[np.int64]
    tiles: NDArray[np.int32]
    masks: NDArray[np.int64]
    bounds: NDArray[np.int64]


def visit_tiles(
    triangles: MovingTriangles, intervals: NDArray[np.float64], spp: int, width: int, height: int, tile: int
) -> Visits:
    """Bound each triangle.

    Parameters
    ----------
    triangles : MovingTriangles
    intervals : ndarray, (n, 6), float64
        Time, u and v, lowest and highest, of neighbouring samples of a pixel each (``intervals_of``).
    spp, width, height, tile : int
    """
    boxes = np.empty((len(triangles.corners), 4), np.int64)
    aperture, focus = triangles.lens
    _boxes(triangles.corners, aperture, focus, width, height, tile, boxes)
    counts = (boxes[:, 2] - boxes[:, 0] + 1) * (boxes[:, 3] - boxes[:, 1] + 1)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    tiles, masks, bounds = (np.empty(starts[-1], kind) for kind in (np.int32, np.int64, np.int64))
    _visit(triangles.corners, aperture, focus, boxes, intervals, spp, -(-width // tile), tile, tiles, masks, bounds)
    return Visits(starts, tiles, masks, bounds)


@kernel
def _boxes(corners: Any, aperture: Any, focus: Any, width: int, height: int, tile: int, boxes: Any) -> None:
    """Tiles x0, y0, x1, y1 of each triangle's box, on screen; x1 = x0 - 1 where it has none."""
    last_x, last_y = (width - 1) // tile, (height - 1) // tile
    for p in range(len(corners)):
        low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
        for k in range(3):
            for t in range(2):
                w = np.float64(corners[p, 0, k, 3]) + t * corners[p, 1, k, 3]
                x = np.float64(corners[p, 0, k, 0]) + t * corners[p, 1, k, 0]
                y = np.float64(corners[p, 0, k, 1]) + t * corners[p, 1, k, 1]
                if w <= TINY * max(abs(x), abs(y)):
                    low_x, low_y, high_x, high_y = -np.inf, -np.inf, np.inf, np.inf
                    break
                blur = abs(aperture * (w - focus) / w) + MARGIN
                low_x, high_x = min(low_x, x / w - blur), max(high_x, x / w + blur)
                low_y, high_y = min(low_y, y / w - blur), max(high_y, y / w + blur)
        if low_x >= width or low_y >= height or high_x < 0 or high_y < 0:
            boxes[p, 0], boxes[p, 1], boxes[p, 2], boxes[p, 3] = 0, 0, -1, -1
            continue
        boxes[p, 0], boxes[p, 2] = max(low_x, 0.0) // tile, min(high_x, width - 1.0) // tile
        boxes[p, 1], boxes[p, 3] = max(low_y, 0.0) // tile, min(high_y, height - 1.0) // tile
        boxes[p, 2], boxes[p, 3] = min(boxes[p, 2], last_x), min(boxes[p, 3], last_y)


@kernel
def _visit(
    corners: Any, aperture: Any, focus: Any, boxes: Any, intervals: Any, spp: int, columns: int, tile: int,
    tiles: Any, masks: Any, bounds: Any,
) -> None:  # fmt: skip
    """Look at the tiles of each box, first over all of shutter and lens, then by interval."""
    at, count = 0, len(intervals)
    for p in range(len(corners)):
        for j in range(boxes[p, 1], boxes[p, 3] + 1):
            for i in range(boxes[p, 0], boxes[p, 2] + 1):
                mask, sides = 0, (i * tile, j * tile, (i + 1) * tile, (j + 1) * tile)
                bounds[at] = 1
                if not stays_off(corners, p, aperture, focus, sides, EVERYTHING):
                    bounds[at] += count if count > 1 else 0
                    for n in range(count):
                        if count > 1 and stays_off(corners, p, aperture, focus, sides, intervals[n]):
                            continue
                        for s in range(n * spp // count, (n + 1) * spp // count):
                            mask |= 1 << s
                tiles[at], masks[at] = j * columns + i, mask
                at += 1


@kernel
def stays_off(corners: Any, p: int, aperture: Any, focus: Any, sides: Any, interval: Any) -> bool:
    """Whether triangle p has no sample in x0 <= x < x1, y0 <= y < y1 over an interval of time and lens."""
    left, top, right, bottom, near, far = True, True, True, True, True, True
    for k in range(3):
        for t in range(2):
            time = interval[t]
            w = np.float64(corners[p, 0, k, 3]) + time * corners[p, 1, k, 3]
            z = np.float64(corners[p, 0, k, 2]) + time * corners[p, 1, k, 2]
            depth_margin = TINY * (abs(z) + abs(w))
            near &= z + w < -depth_margin
            far &= w - z < -depth_margin
            for d in range(2):
                way = np.float64(corners[p, 0, k, d]) + time * corners[p, 1, k, d]
                for end in range(2):
                    at = way + aperture * interval[2 + 2 * d + end] * (w - focus)
                    margin = MARGIN * abs(w) + TINY * abs(at)
                    before, after = at - sides[d] * w < -margin, sides[2 + d] * w - at < -margin
                    if d == 0:
                        left &= before
                        right &= after
                    else:
                        top &= before
                        bottom &= after
    return bool(left or top or right or bottom or near or far)
