"""Vertices on the screen: what a triangle of the original finds for its corners, found once for all that share one."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.subtriangle import View, depth_at, snapped

BEYOND = 0b111111  # bits of a code: on the far side of x = w, x = -w, y = w, ...
CLIP = 64  # bit: no triangle with this corner is drawn whole (the guard band is looked at later)
_PART_VERTICES = 4096  # that one call of the worker takes, at least


class Screen(NamedTuple):
    """The vertices that a draw uses; the others are not filled in."""

    codes: NDArray[np.uint8]  # (V,) ``BEYOND`` and ``CLIP``
    places: NDArray[np.int32]  # (V, 2) snapped x and y, 1/16 pixel from the viewport's centre
    ratios: NDArray[np.float32]  # (V, 2) 1 / w and depth


@kernel(error_model="numpy")
def _project_part(part: int, parts: int, positions: Any, low: int, high: int, view: View, screen: Screen) -> None:
    """Project a share of the vertices from ``low`` to ``high``; a NaN among the numbers of a corner is ignored."""
    zero = np.float32(0)
    for v in range(low + (high - low) * part // parts, low + (high - low) * (part + 1) // parts):
        x, y, z, w = positions[v, 0], positions[v, 1], positions[v, 2], positions[v, 3]
        along_z = (w < z) << 4 | (w < -z) << 5
        code = (w < x) | (w < -x) << 1 | (w < y) << 2 | (w < -y) << 3 | along_z
        comparable = abs(z) >= zero or (not view.guard_band and (abs(x) >= zero or abs(y) >= zero))
        if (along_z if view.guard_band else code) or not comparable or w != w:  # noqa: PLR0124 - NaN
            code |= CLIP
        inverse = np.float32(1) / w
        screen.codes[v] = code
        screen.places[v, 0], screen.places[v, 1] = snapped(x, y, inverse, view)
        screen.ratios[v, 0], screen.ratios[v, 1] = inverse, depth_at(z, inverse)


def screen_vertices(positions: NDArray[np.float32], triangles: NDArray[np.int32], view: View) -> Screen:
    """Project the vertices from the first to the last that the triangles use."""
    V = len(positions)
    screen = Screen(np.empty(V, np.uint8), np.empty((V, 2), np.int32), np.empty((V, 2), np.float32))
    if triangles.size and V:
        low, high = max(int(triangles.min()), 0), min(int(triangles.max()) + 1, V)
        for_parts(_project_part, parts_of(high - low, _PART_VERTICES), positions, low, high, view, screen)
    return screen
