"""Micropolygons on screen: made from patches, cages and meshes (Fatahalian et al. 2009: about a pixel each)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes import catmull_clark
from tilestamp.simulator.scenes.scene import Mesh, Patches, Scene
from tilestamp.simulator.stages.laine2011.exact import fma64

GUARD_PIXELS = 1 << 17  # beyond it the sub-pixel arithmetic would not fit 64 bits
NEAR = 1e-6  # least w: polygons that cross the eye's plane are dropped, and counted
LIGHT = (0.36, 0.48, 0.8)  # unit vector towards the light, model space
MOST_RATE = 256  # micropolygons along the side of a patch


class Micropolygons(NamedTuple):
    """A set of polygons in screen space.

    Parameters
    ----------
    vertices : ndarray, (M, 3 or 4, 3), float32
        x and y in pixels, y down, and depth, nearer is smaller. A quad is the two triangles 0 1 2 and 0 2 3.
    patch : ndarray, (M,), int32
        The patch, cage face or input triangle that each comes from; never decreasing.
    shade : ndarray, (M,), uint8
        Grey that it is drawn in.
    dropped : int
        Polygons left out because they cross the eye's plane or lie far off screen.
    """

    vertices: NDArray[np.float32]
    patch: NDArray[np.int32]
    shade: NDArray[np.uint8]
    dropped: int = 0


def micropolygons(
    scene: Scene, matrix: ArrayLike, width: int, height: int, size: float = 1.0, triangles: bool = False
) -> Micropolygons:
    """Make the micropolygons of a scene: patches diced to ``size`` pixels an edge, triangles as they are."""
    if scene.patches is not None:
        return from_patches(scene.patches, matrix, width, height, size, triangles)
    if scene.mesh is None:
        raise TilestampError(f"{scene.name} has neither patches nor triangles")
    return from_mesh(scene.mesh, matrix, width, height)


def from_patches(
    patches: Patches, matrix: ArrayLike, width: int, height: int, size: float = 1.0, triangles: bool = False
) -> Micropolygons:
    """Dice each patch evenly, so that its longest control polygon is cut to pieces of at most ``size`` pixels."""
    points, matrix = patches.points.astype(np.float64), np.asarray(matrix, np.float64)
    rates, ends = _rates(points, matrix, width, height, size)
    made = _room(int(ends[-1]) if len(ends) else 0, 4)
    for_parts(_dice, parts_of(len(rates)), points, rates, ends, matrix, width, height, *made)
    return _drawable(*made, np.repeat(np.arange(len(rates), dtype=np.int32), rates**2), triangles)


def diced(
    patches: Patches, matrix: ArrayLike, width: int, height: int, size: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners of a patch's micropolygons in its own space, (M, 4, 4), and the patch of each."""
    points = patches.points.astype(np.float64)
    rates, ends = _rates(points, np.asarray(matrix, np.float64), width, height, size)
    polygons = np.empty((int(ends[-1]) if len(ends) else 0, 4, 4))
    for_parts(_evaluate, parts_of(len(rates)), points, rates, ends, polygons)
    return polygons, np.repeat(np.arange(len(rates)), rates**2)


def from_surface(
    surface: catmull_clark.Surface, matrix: ArrayLike, width: int, height: int, triangles: bool = False
) -> Micropolygons:
    """Take the quads of a subdivided cage at their limit positions, each face of the cage a patch."""
    limits = catmull_clark.limit_positions(surface)
    points = np.concatenate([limits, np.ones((len(limits), 1))], axis=1)
    return _on_screen(points[surface.quads], surface.cage_face, matrix, width, height, triangles)


def from_mesh(mesh: Mesh, matrix: ArrayLike, width: int, height: int) -> Micropolygons:
    """Take triangles as they are, each a patch of its own."""
    matrix = np.eye(4) if mesh.clip_space else matrix
    polygons = mesh.positions.astype(np.float64)[mesh.triangles]
    return _on_screen(polygons, np.arange(len(polygons)), matrix, width, height, triangles=False)


def grouped(polygons: Micropolygons, size: int) -> Micropolygons:
    """Give ``size`` consecutive polygons one patch: a triangle mesh has none of its own."""
    return polygons._replace(patch=(np.arange(len(polygons.patch)) // size).astype(np.int32))


def _on_screen(
    polygons: NDArray[np.float64], patch: NDArray[np.int64] | NDArray[np.int32], matrix: ArrayLike, width: int,
    height: int, triangles: bool,
) -> Micropolygons:  # fmt: skip
    """Project, shade, and leave out what cannot be drawn."""
    made = _room(*polygons.shape[:2])
    for_parts(_place, parts_of(len(polygons), 256), polygons, np.asarray(matrix, np.float64), width, height, *made)
    return _drawable(*made, patch.astype(np.int32), triangles)


def _room(count: int, corners: int) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.bool_]]:
    """Arrays to fill: vertices, greys, and which polygons can be drawn."""
    return np.empty((count, corners, 3), np.float32), np.empty(count, np.uint8), np.empty(count, np.bool_)


def _drawable(
    vertices: NDArray[np.float32], shade: NDArray[np.uint8], kept: NDArray[np.bool_], patch: NDArray[np.int32],
    triangles: bool,
) -> Micropolygons:  # fmt: skip
    """Leave out what cannot be drawn, and split quads where wanted."""
    dropped = len(kept) - int(np.count_nonzero(kept))
    if dropped:
        vertices, patch, shade = vertices[kept], patch[kept], shade[kept]
    made = Micropolygons(vertices, patch, shade, dropped)
    return _split(made) if triangles and vertices.shape[1] == 4 else made


def _split(polygons: Micropolygons) -> Micropolygons:
    """Each quad as its two triangles."""
    halves = polygons.vertices[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    return Micropolygons(halves, np.repeat(polygons.patch, 2), np.repeat(polygons.shade, 2), polygons.dropped)


def project(
    points: NDArray[np.float64], matrix: ArrayLike, width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Screen positions (V, 3) of homogeneous points, and which of them can be used."""
    screen, usable = np.empty((len(points), 3)), np.empty(len(points), np.bool_)
    _project(points, np.asarray(matrix, np.float64), width, height, screen, usable)
    return screen, usable


def shades(polygons: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Grey by the angle between normal and light, from either side."""
    greys = np.empty(len(polygons), np.uint8)
    for_parts(_shades, parts_of(len(polygons), 256), polygons, greys)
    return greys


def _rates(
    points: NDArray[np.float64], matrix: NDArray[np.float64], width: int, height: int, size: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Micropolygons along a patch's side: its longest control polygon in pixels over ``size``, rounded up; their ends.

    ``ends``: where the micropolygons of each patch end.
    """
    grid = project(points.reshape(-1, 4), matrix, width, height)[0].reshape(-1, 4, 4, 3)[..., :2]
    rows = np.linalg.norm(np.diff(grid, axis=2), axis=-1).sum(axis=2).max(axis=1)
    columns = np.linalg.norm(np.diff(grid, axis=1), axis=-1).sum(axis=1).max(axis=1)
    wanted = np.clip(np.maximum(rows, columns) / size, 1.0, MOST_RATE)
    rates: NDArray[np.int64] = np.ceil(wanted).astype(np.int64)
    return rates, np.cumsum(rates**2)


@kernel(lent=True, error_model="numpy")
def _to_screen(point: Any, matrix: Any, width: int, height: int, screen: Any) -> bool:
    """Project one homogeneous point to ``screen``; whether it can be used, else it lies at 0."""
    w = _row(point, matrix[3])
    if not w > NEAR:
        screen[0] = screen[1] = screen[2] = 0.0
        return False
    inverse = 1.0 / w
    x = (0.5 + 0.5 * _row(point, matrix[0]) * inverse) * width
    y = (0.5 - 0.5 * _row(point, matrix[1]) * inverse) * height
    z = 0.5 + 0.5 * _row(point, matrix[2]) * inverse
    usable = abs(x) < GUARD_PIXELS and abs(y) < GUARD_PIXELS
    screen[0], screen[1], screen[2] = (x, y, z) if usable else (0.0, 0.0, 0.0)
    return bool(usable)


@kernel(lent=True, inline=True)
def _row(point: Any, of: Any) -> Any:
    """One row of a matrix times a point, as BLAS rounds it."""
    return fma64(point[3], of[3], fma64(point[2], of[2], fma64(point[1], of[1], point[0] * of[0])))


@kernel(lent=True, error_model="numpy")
def _shade(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Grey of a polygon of corners a, b, c and d (d is c in a triangle)."""
    x, y, z = c[0] / c[3] - a[0] / a[3], c[1] / c[3] - a[1] / a[3], c[2] / c[3] - a[2] / a[3]
    u, v, w = d[0] / d[3] - b[0] / b[3], d[1] / d[3] - b[1] / b[3], d[2] / d[3] - b[2] / b[3]
    nx, ny, nz = y * w - z * v, z * u - x * w, x * v - y * u
    length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-30)
    lit = abs(nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2]) / length
    return np.uint8(40.0 + 200.0 * min(lit, 1.0)) if lit >= 0 else np.uint8(0)  # of what is not a number


@kernel(lent=True)
def _project(points: Any, matrix: Any, width: int, height: int, screen: Any, usable: Any) -> None:
    for p in range(len(points)):
        usable[p] = _to_screen(points[p], matrix, width, height, screen[p])


@kernel(lent=True)
def _shades(part: int, parts: int, polygons: Any, greys: Any) -> None:
    last = polygons.shape[1] - 1
    for p in range(part * len(polygons) // parts, (part + 1) * len(polygons) // parts):
        greys[p] = _shade(polygons[p, 0], polygons[p, 1], polygons[p, 2], polygons[p, last])


@kernel(lent=True)
def _place(
    part: int, parts: int, polygons: Any, matrix: Any, width: int, height: int, vertices: Any, shade: Any, kept: Any
) -> None:
    """Project and shade a share of the polygons."""
    last = polygons.shape[1] - 1
    for p in range(part * len(polygons) // parts, (part + 1) * len(polygons) // parts):
        kept[p] = True
        for k in range(last + 1):
            kept[p] &= _to_screen(polygons[p, k], matrix, width, height, vertices[p, k])
        shade[p] = _shade(polygons[p, 0], polygons[p, 1], polygons[p, 2], polygons[p, last])


@kernel
def _dice(
    part: int, parts: int, points: Any, rates: Any, ends: Any, matrix: Any, width: int, height: int, vertices: Any,
    shade: Any, kept: Any,
) -> None:  # fmt: skip
    """Evaluate, project and shade a share of the patches, each vertex of a patch once."""
    first, last = part * len(rates) // parts, (part + 1) * len(rates) // parts
    side = rates[first:last].max() + 1 if last > first else 0
    grid, screen = np.empty((side, side, 4)), np.empty((side, side, 3), np.float32)
    usable = np.empty((side, side), np.bool_)
    for p in range(first, last):
        _surface(points[p], rates[p], grid)
        for i in range(rates[p] + 1):
            for j in range(rates[p] + 1):
                usable[i, j] = _to_screen(grid[i, j], matrix, width, height, screen[i, j])
        at = ends[p] - rates[p] * rates[p]
        for i in range(rates[p]):
            for j in range(rates[p]):
                kept[at] = usable[i, j] and usable[i, j + 1] and usable[i + 1, j] and usable[i + 1, j + 1]
                shade[at] = _shade(grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j])
                _quad(screen, i, j, vertices[at])
                at += 1


@kernel
def _evaluate(part: int, parts: int, points: Any, rates: Any, ends: Any, polygons: Any) -> None:
    """Fill ``polygons`` (sum of rates^2, 4, 4) with the quads of a share of the patches, row by row."""
    first, last = part * len(rates) // parts, (part + 1) * len(rates) // parts
    side = rates[first:last].max() + 1 if last > first else 0
    grid = np.empty((side, side, 4))
    for p in range(first, last):
        _surface(points[p], rates[p], grid)
        at = ends[p] - rates[p] * rates[p]
        for i in range(rates[p]):
            for j in range(rates[p]):
                _quad(grid, i, j, polygons[at])
                at += 1


@kernel(lent=True, inline=True)
def _quad(grid: Any, i: int, j: int, quad: Any) -> None:
    """Copy the four corners of a quad of the grid, in turn."""
    for d in range(quad.shape[1]):
        quad[0, d], quad[1, d] = grid[i, j, d], grid[i, j + 1, d]
        quad[2, d], quad[3, d] = grid[i + 1, j + 1, d], grid[i + 1, j, d]


@kernel
def _surface(points: Any, rate: int, grid: Any) -> None:
    """Points of a patch at (rate + 1) x (rate + 1) places."""
    u, v = np.empty(4), np.empty(4)
    for i in range(rate + 1):
        _bernstein(i / rate, v)
        for j in range(rate + 1):
            _bernstein(j / rate, u)
            x, y, z, w = 0.0, 0.0, 0.0, 0.0
            for r in range(4):
                for c in range(4):
                    weight = v[r] * u[c]
                    x += weight * points[4 * r + c, 0]
                    y += weight * points[4 * r + c, 1]
                    z += weight * points[4 * r + c, 2]
                    w += weight * points[4 * r + c, 3]
            grid[i, j, 0], grid[i, j, 1], grid[i, j, 2], grid[i, j, 3] = x, y, z, w


@kernel(lent=True)
def _bernstein(t: Any, out: Any) -> None:
    s = 1.0 - t
    out[0] = s * s * s
    out[1] = 3.0 * s * s * t
    out[2] = 3.0 * s * t * t
    out[3] = t * t * t
