"""Vertices on the screen: what a triangle of the original finds for its corners, found once for all that share one."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.subtriangle import View, depth_at, snapped

ASIDE = -(2**31)  # word of a vertex whose triangles are looked at one by one
BEYOND = 0b111111  # bits of a code: on the far side of x = w, x = -w, y = w, ...
CLIP = 64  # bit: no triangle with this corner is drawn whole (the guard band is looked at later)
NEAR = 2**14  # 1/16 pixel: no triangle of such vertices spans too much
_PART_VERTICES = 4096  # that one call of the worker takes, at least
_1, _2, _3 = np.uint64(1), np.uint64(2), np.uint64(3)


class Screen(NamedTuple):
    """The vertices that a draw uses; the others are not filled in."""

    codes: NDArray[np.uint8]  # (V,) ``BEYOND`` and ``CLIP``
    words: NDArray[np.int32]  # (V,) snapped x, and y << 16, 1/16 pixel from the viewport's centre; or ``ASIDE``
    ratios: NDArray[np.float32]  # (V * 2) 1 / w and depth


@kernel(lent=True, inline=True)
def unpacked(word: Any) -> Any:
    """Snapped x and y, int32."""
    return np.int32(np.int16(word)), np.int32(word >> 16)


@kernel(lent=True, inline=True)
def place_of(screen: Screen, positions: Any, i: int, view: View) -> Any:
    """Snapped x and y of a vertex, int64."""
    word = screen.words[i]
    if word == ASIDE:
        return snapped(positions[4 * i], positions[4 * i + 1], screen.ratios[2 * i], view)
    x, y = unpacked(word)
    return np.int64(x), np.int64(y)


@kernel(error_model="numpy", lent=True)
def _project_part(part: int, parts: int, positions: Any, low: int, high: int, view: View, screen: Screen) -> None:
    """Project a share of the vertices from ``low`` to ``high``; a NaN among the numbers of a corner is ignored.

    ``positions`` are flat, and there is no branch: compiled code takes several vertices at a time.
    """
    zero = np.float32(0)
    for v in range(low + (high - low) * part // parts, low + (high - low) * (part + 1) // parts):
        at = np.uint64(4 * v)  # without a sign, an index is not looked at
        x, y, z, w = positions[at], positions[at + _1], positions[at + _2], positions[at + _3]
        along_z = (w < z) << 4 | (w < -z) << 5
        code = (w < x) | (w < -x) << 1 | (w < y) << 2 | (w < -y) << 3 | along_z
        comparable = (abs(z) >= zero) | ((not view.guard_band) & ((abs(x) >= zero) | (abs(y) >= zero)))
        whole = ((along_z if view.guard_band else code) == 0) & comparable & (w == w)  # noqa: PLR0124 - NaN
        code |= 0 if whole else CLIP
        inverse = np.float32(1) / w
        sx, sy = snapped(x, y, inverse, view)
        near = (code == 0) & (abs(sx) < NEAR) & (abs(sy) < NEAR)
        screen.codes[np.uint64(v)] = code
        screen.words[np.uint64(v)] = (sx & 0xFFFF) | sy << 16 if near else ASIDE
        screen.ratios[np.uint64(2 * v)] = inverse
        screen.ratios[np.uint64(2 * v) + _1] = depth_at(z, inverse)


def screen_vertices(positions: NDArray[np.float32], used: tuple[int, int], view: View) -> Screen:
    """Project the vertices from the first to the last that the triangles use."""
    V = len(positions)
    screen = Screen(np.empty(V, np.uint8), np.empty(V, np.int32), np.empty(2 * V, np.float32))
    low, high = max(used[0], 0), min(used[1] + 1, V)
    if low < high:
        for_parts(_project_part, parts_of(high - low, _PART_VERTICES), positions.ravel(), low, high, view, screen)
    return screen
