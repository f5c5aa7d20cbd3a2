"""Triangles that move behind a thin lens, in homogeneous pixels, and the test of a sample (Laine & Karras 2011).

A corner goes on a straight line in clip space while the shutter is open. A point of the lens moves it by its signed
circle of confusion, ``aperture (w - focus) / w`` pixels, which is linear before the division by w. So a corner seen
from a sample is X = x(t) + w(t) (aperture u - sx) - aperture u focus, Y alike; what depends on the sample alone is
computed once for all triangles. Then an edge is X_i Y_j - X_j Y_i, and the three edges are the weights of the corners.

Multiply-adds of a test: 9 for the time, 12 for lens and sample (6 without a lens), 6 for the edges: 27 in five
dimensions, 21 in three. Published: "approximately 25" in five (Laine & Karras 2011, NVIDIA technical report "Efficient
Triangle Coverage Tests for Stochastic Rasterization", abstract). Nothing is divided and nothing is clipped: corners
behind the eye are as good as others. An edge of two triangles has the same number in both but for its sign, in any
precision (where the compiler does not contract), so that a mesh has neither cracks nor samples covered twice.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons, diced, shades

CORNER = 4  # x and y in pixels times w, z, w


class Lens(NamedTuple):
    """A thin lens: radius in pixels of the circle of confusion of what is infinitely far, and w of what is sharp."""

    aperture: float
    focus: float


class MovingTriangles(NamedTuple):
    """Triangles at the opening of the shutter, and the way to its closing.

    Parameters
    ----------
    corners : ndarray, (M, 2, 3, 4), float32 or float64
        Place and way of each corner: x w, y w (pixels, y down), z, w.
    lens : Lens
    """

    corners: NDArray[Any]
    lens: Lens


def homogeneous_pixels(clip: NDArray[np.float64], width: int, height: int) -> NDArray[np.float32]:
    """Clip positions (..., 4) as x w and y w in pixels, y down, z and w."""
    x, y, z, w = np.moveaxis(clip, -1, 0)
    return np.stack([(w + x) / 2 * width, (w - y) / 2 * height, z, w], axis=-1).astype(np.float32)


def scene_triangles(
    scene: Scene, matrix: ArrayLike, width: int, height: int, size: float
) -> tuple[NDArray[np.float64], Micropolygons]:
    """Triangles of a scene in clip space (M, 3, 4), patches diced to ``size`` pixels; their patches and greys."""
    if scene.patches is not None:
        points, patch = diced(scene.patches, matrix, width, height, size)
        grey, patch = np.repeat(shades(points), 2), np.repeat(patch, 2)
        points = points[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 4)
    elif scene.mesh is not None:
        points = scene.mesh.positions.astype(np.float64)[scene.mesh.triangles]
        patch, grey = np.arange(len(points)), shades(points)
        matrix = np.eye(4) if scene.mesh.clip_space else matrix
    else:
        raise TilestampError(f"{scene.name} has neither patches nor triangles")
    no_places = np.empty((len(points), 3, 3), np.float32)  # on screen: they are homogeneous
    return points @ np.asarray(matrix, np.float64).T, Micropolygons(no_places, patch.astype(np.int32), grey)


def moving_triangles(
    start: NDArray[np.float32], end: NDArray[np.float32], lens: Lens, *, double: bool
) -> MovingTriangles:
    """Triangles (M, 3, 4) in homogeneous pixels at both ends of the shutter interval."""
    kind: type[np.floating[Any]] = np.float64 if double else np.float32
    first, last = np.asarray(start, kind), np.asarray(end, kind)
    return MovingTriangles(np.ascontiguousarray(np.stack([first, last - first], axis=1)), lens)


@kernel(lent=True)
def seen_from(corners: Any, p: int, time: Any, a: Any, b: Any, seen: Any) -> None:
    """Place triangle p as a sample sees it: X, Y and w of each corner.

    ``a`` (x, y) is aperture times lens point less the sample's place, ``b`` aperture times lens point times focus.
    """
    for k in range(3):
        w = corners[p, 0, k, 3] + time * corners[p, 1, k, 3]
        for d in range(2):
            at = corners[p, 0, k, d] + time * corners[p, 1, k, d]
            seen[k, d] = (at - b[d]) + w * a[d]
        seen[k, 2] = w


@kernel(lent=True)
def edge(seen: Any, i: int, j: int) -> Any:
    """Edge function of corners i and j at the sample: the weight of the third corner."""
    return seen[i, 0] * seen[j, 1] - seen[j, 0] * seen[i, 1]


@kernel(lent=True)
def _owns(seen: Any, i: int, j: int, positive: bool) -> bool:
    """Whether an edge through the sample is a left edge, or a top one: its triangle has the sample."""
    right = seen[j, 2] * seen[i, 1] - seen[i, 2] * seen[j, 1]  # how the edge function grows to the right, and down
    down = seen[i, 2] * seen[j, 0] - seen[j, 2] * seen[i, 0]
    if positive:
        return bool(right > 0 or (right == 0 and down > 0))
    return bool(right < 0 or (right == 0 and down < 0))


@kernel(lent=True)
def covers(seen: Any, weights: Any) -> bool:
    """Test a sample: whether the line of sight goes through the triangle, before or behind the eye; fills weights."""
    weights[0], weights[1], weights[2] = edge(seen, 1, 2), edge(seen, 2, 0), edge(seen, 0, 1)
    positive = weights[0] > 0 or weights[1] > 0 or weights[2] > 0
    negative = weights[0] < 0 or weights[1] < 0 or weights[2] < 0
    if positive == negative:
        return False
    for k in range(3):  # noqa: SIM110 - Numba takes no generators
        if weights[k] == 0 and not _owns(seen, (k + 1) % 3, (k + 2) % 3, positive):
            return False
    return True


@kernel(lent=True)
def depth_of(corners: Any, p: int, time: Any, seen: Any, weights: Any) -> Any:
    """Depth of a covered sample, 0 near to 1 far; -1 where it lies behind the eye, or before near or behind far."""
    z, w, total = np.float64(0), np.float64(0), weights[0] + weights[1] + weights[2]
    for k in range(3):
        z += weights[k] * (corners[p, 0, k, 2] + time * corners[p, 1, k, 2])
        w += weights[k] * seen[k, 2]
    if (w > 0) != (total > 0) or w == 0 or abs(z) > abs(w):
        return np.float32(-1.0)
    return np.float32(0.5 + 0.5 * (z / w))


@kernel(lent=True)
def depth_along(normals: Any, volumes: Any, p: int, ray: Any, weights: Any) -> Any:
    """Test a line of sight from the eye: distance over 1 + distance where it meets triangle p, -1 where it does not.

    A line through an edge goes to the triangle that it would meet a little further along x; then along y; then along z.
    """
    for k in range(3):
        weights[k] = normals[p, k, 0] * ray[0] + normals[p, k, 1] * ray[1] + normals[p, k, 2] * ray[2]
    positive = weights[0] > 0 or weights[1] > 0 or weights[2] > 0
    if positive == (weights[0] < 0 or weights[1] < 0 or weights[2] < 0) or (volumes[p] > 0) != positive:
        return np.float32(-1.0)
    for k in range(3):
        if weights[k] == 0:
            x, y, z = normals[p, k, 0], normals[p, k, 1], normals[p, k, 2]
            first = x if x != 0 else y if y != 0 else z
            if first == 0 or (first > 0) != positive:
                return np.float32(-1.0)
    distance = volumes[p] / (weights[0] + weights[1] + weights[2])
    return np.float32(distance / (1 + distance)) if distance > 0 else np.float32(-1.0)
