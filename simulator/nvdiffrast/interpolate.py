"""``interpolate``: vertex attributes at each pixel, and how they change from pixel to pixel."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.nvdiffrast.arrays import Array, as_array, as_triangles, need_axis, same_batch
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.exact import fma

MAX_LISTED = 32  # attributes in diff_attrs; "all" takes any number
GROUP_ROWS, GROUP_COLUMNS = 4, 8  # pixels of a warp
_ONE = np.float32(1)


@kernel(error_model="numpy", lent=True)
def _corners(triangle: int, tri: Any, vertices: int) -> Any:
    """Vertices of a triangle, (0, 0, 0) where there is none, and whether they exist."""
    if not 0 <= triangle < len(tri):
        return 0, 0, 0, True
    i, j, k = np.int64(tri[triangle, 0]), np.int64(tri[triangle, 1]), np.int64(tri[triangle, 2])
    return i, j, k, min(i, j, k) >= 0 and max(i, j, k) < vertices


@kernel(error_model="numpy", lent=True)
def _pixel(attr: Any, corners: Any, weights: Any, steps: Any, diff: Any, out: Any, out_da: Any) -> None:
    i, j, k, _ = corners
    u, v, b = weights
    for a in range(attr.shape[1]):
        out[a] = fma(b, attr[k, a], fma(u, attr[i, a], v * attr[j, a]))
    for n in range(len(diff)):
        a = diff[n]
        if a >= 0:
            along_u, along_v = attr[i, a] - attr[k, a], attr[j, a] - attr[k, a]
            out_da[2 * n] = fma(steps[0], along_u, steps[2] * along_v)
            out_da[2 * n + 1] = fma(steps[1], along_u, steps[3] * along_v)


@kernel(error_model="numpy", lent=True)
def _drawn(rast: Any, top: int, left: int, triangles: int) -> Any:
    """Whether a warp's pixels hold a triangle; one of which all are empty writes zeros."""
    for y in range(top, min(top + GROUP_ROWS, rast.shape[0])):
        for x in range(left, min(left + GROUP_COLUMNS, rast.shape[1])):
            if 0 < rast[y, x, 3] <= triangles:
                return True
    return False


@kernel(error_model="numpy")
def _rows_part(
    part: int, parts: int, attr: Any, rast: Any, tri: Any, rast_db: Any, diff: Any, out: Any, out_da: Any
) -> None:
    """Take a share of the rows of warps; a pixel without a triangle has weights 0 at vertex 0, as the original's."""
    height, width = rast.shape[:2]
    rows = (height + GROUP_ROWS - 1) // GROUP_ROWS
    zero, none = np.float32(0), np.zeros(4, np.float32)
    for top in range(rows * part // parts * GROUP_ROWS, rows * (part + 1) // parts * GROUP_ROWS, GROUP_ROWS):
        for left in range(0, width, GROUP_COLUMNS):
            if not _drawn(rast, top, left, len(tri)):
                continue
            for y in range(top, min(top + GROUP_ROWS, height)):
                for x in range(left, min(left + GROUP_COLUMNS, width)):
                    triangle = int(rast[y, x, 3]) - 1
                    corners = _corners(triangle, tri, len(attr))
                    if not corners[3]:
                        continue
                    valid = 0 <= triangle < len(tri)
                    u, v = rast[y, x, 0], rast[y, x, 1]
                    weights = (u, v, (_ONE - u) - v) if valid else (zero, zero, zero)
                    steps = rast_db[y, x] if valid and len(diff) else none
                    _pixel(attr, corners, weights, steps, diff, out[y, x], out_da[y, x])


def interpolate(
    attr: Array,
    rast: Array,
    tri: Array,
    rast_db: Array | None = None,
    diff_attrs: Sequence[int] | Literal["all"] | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Interpolate vertex attributes as ``nvdiffrast.torch.interpolate`` does.

    Parameters
    ----------
    attr : array, (B, V, A), (1, V, A) or (V, A), float32
        Attributes of the vertices: of each image, or one for all.
    rast : array, (B, H, W, 4), float32
        From ``rasterize``.
    tri : array, (F, 3), int32
    rast_db : array, (B, H, W, 4), float32, optional
        From ``rasterize``; needed for derivatives.
    diff_attrs : sequence of int or "all", optional
        Attributes of which derivatives are wanted, at most 32 in a list. Negative ones count from the end; the
        derivatives of those that do not exist are 0.

    Returns
    -------
    out : ndarray, (B, H, W, A), float32
        Where nothing was drawn, 0 times an attribute of vertex 0 if the warp (8x4 pixels) has drawn a pixel, so a
        negative zero or NaN is possible, as in the original; elsewhere 0.
    out_da : ndarray, (B, H, W, 2 * len(diff_attrs)), float32
        dA/dX and dA/dY of each attribute listed.

    Raises
    ------
    TilestampError
        For other shapes and types, and for ``diff_attrs`` without ``rast_db``.
    """
    attr = as_array("attr", attr, np.float32, "[B, V, A] or [V, A]", 2, 3)
    rast = as_array("rast", rast, np.float32, "[B, H, W, 4]", 4)
    need_axis("rast", rast, 3, 4, "[B, H, W, 4]")
    tri = as_triangles(tri)
    images = attr[None] if attr.ndim == 2 else attr
    if len(images) > 1:
        same_batch(len(rast), len(images), "rast and attr")
    count = images.shape[2]
    diff = _listed(diff_attrs, count)
    steps = rast  # not read without diff_attrs
    if len(diff):
        steps = as_array("rast_db (needed by diff_attrs)", rast_db, np.float32, "[B, H, W, 4]", 4)
        if steps.shape != rast.shape:
            raise TilestampError(f"rast_db {list(steps.shape)} must be as large as rast {list(rast.shape)}")
    out = np.zeros((*rast.shape[:3], count), np.float32)
    out_da = np.zeros((*rast.shape[:3], 2 * len(diff)), np.float32)
    parts = parts_of(-(-rast.shape[1] // GROUP_ROWS), 4)
    with np.errstate(all="ignore"):
        for b in range(len(rast)):
            for_parts(_rows_part, parts, images[b % len(images)], rast[b], tri, steps[b], diff, out[b], out_da[b])
    return out, out_da


def _listed(diff_attrs: Sequence[int] | Literal["all"] | None, count: int) -> NDArray[np.int64]:
    """Attributes to differentiate, -1 for those that do not exist."""
    if diff_attrs is None:
        return np.empty(0, np.int64)
    if isinstance(diff_attrs, str):
        if diff_attrs != "all":
            raise TilestampError(f"diff_attrs must be a list of attributes or 'all', not {diff_attrs!r}")
        return np.arange(count)
    try:
        listed = np.array([int(a) for a in diff_attrs], np.int64)
    except (TypeError, ValueError, OverflowError):
        raise TilestampError(f"diff_attrs must be a list of attributes or 'all', not {diff_attrs!r}") from None
    if len(listed) > MAX_LISTED:
        raise TilestampError(f"diff_attrs has {len(listed)} entries, more than the {MAX_LISTED} of the original")
    listed[listed < 0] += count
    return np.where((listed >= 0) & (listed < count), listed, -1)
