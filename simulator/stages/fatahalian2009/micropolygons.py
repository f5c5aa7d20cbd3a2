"""Micropolygons on screen: made from patches, cages and meshes (Fatahalian et al. 2009: about a pixel each)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes import catmull_clark
from tilestamp.simulator.scenes.scene import Mesh, Patches, Scene

GUARD_PIXELS = 1 << 17  # beyond it the sub-pixel arithmetic would not fit 64 bits
NEAR = 1e-6  # least w: polygons that cross the eye's plane are dropped, and counted
LIGHT = np.array([0.36, 0.48, 0.8])  # unit vector towards the light, model space
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
    return _on_screen(*diced(patches, matrix, width, height, size), matrix, width, height, triangles)


def diced(
    patches: Patches, matrix: ArrayLike, width: int, height: int, size: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners of a patch's micropolygons in its own space, (M, 4, 4), and the patch of each."""
    points = patches.points.astype(np.float64)
    rates = _rates(project(points.reshape(-1, 4), matrix, width, height)[0].reshape(-1, 16, 3), size)
    ends = np.cumsum(rates**2)
    polygons = np.empty((int(ends[-1]) if len(ends) else 0, 4, 4))
    _evaluate(points, rates, ends, polygons)
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
    corners = polygons.shape[1]
    screen, usable = project(polygons.reshape(-1, 4), matrix, width, height)
    kept = usable.reshape(-1, corners).all(axis=1)
    vertices = screen.reshape(-1, corners, 3).astype(np.float32)[kept]
    made = Micropolygons(vertices, patch[kept].astype(np.int32), shades(polygons)[kept], int((~kept).sum()))
    return _split(made) if triangles and corners == 4 else made


def _split(polygons: Micropolygons) -> Micropolygons:
    """Each quad as its two triangles."""
    halves = polygons.vertices[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    return Micropolygons(halves, np.repeat(polygons.patch, 2), np.repeat(polygons.shade, 2), polygons.dropped)


def project(
    points: NDArray[np.float64], matrix: ArrayLike, width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Screen positions (V, 3) of homogeneous points, and which of them can be used."""
    clip = points @ np.asarray(matrix, np.float64).T
    usable = clip[:, 3] > NEAR
    inverse = 1.0 / np.where(usable, clip[:, 3], 1.0)
    screen = np.empty((len(clip), 3))
    screen[:, 0] = (0.5 + 0.5 * clip[:, 0] * inverse) * width
    screen[:, 1] = (0.5 - 0.5 * clip[:, 1] * inverse) * height
    screen[:, 2] = 0.5 + 0.5 * clip[:, 2] * inverse
    usable &= (np.abs(screen[:, :2]) < GUARD_PIXELS).all(axis=1)
    screen[~usable] = 0.0
    return screen, usable


def shades(polygons: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Grey by the angle between normal and light, from either side."""
    points = polygons[:, :, :3] / polygons[:, :, 3:]
    normals = np.cross(points[:, 2] - points[:, 0], points[:, -1] - points[:, 1])
    length = np.maximum(np.linalg.norm(normals, axis=1), 1e-30)
    lit = np.abs(normals @ LIGHT) / length
    greys: NDArray[np.uint8] = (40.0 + 200.0 * np.minimum(lit, 1.0)).astype(np.uint8)
    return greys


def _rates(nets: NDArray[np.float64], size: float) -> NDArray[np.int64]:
    """Micropolygons along a patch's side: its longest control polygon in pixels over ``size``, rounded up."""
    grid = nets.reshape(-1, 4, 4, 3)[..., :2]
    rows = np.linalg.norm(np.diff(grid, axis=2), axis=-1).sum(axis=2).max(axis=1)
    columns = np.linalg.norm(np.diff(grid, axis=1), axis=-1).sum(axis=1).max(axis=1)
    wanted = np.clip(np.maximum(rows, columns) / size, 1.0, MOST_RATE)
    rates: NDArray[np.int64] = np.ceil(wanted).astype(np.int64)
    return rates


@kernel
def _evaluate(points: Any, rates: Any, ends: Any, polygons: Any) -> None:
    """Fill ``polygons`` (sum of rates^2, 4, 4) with the quads of each patch, row by row."""
    grid = np.empty((rates.max() + 1, rates.max() + 1, 4)) if len(rates) else np.empty((0, 0, 4))
    u = np.empty(4)
    v = np.empty(4)
    for p in range(len(rates)):
        rate = rates[p]
        for i in range(rate + 1):
            _bernstein(i / rate, v)
            for j in range(rate + 1):
                _bernstein(j / rate, u)
                for d in range(4):
                    total = 0.0
                    for r in range(4):
                        for c in range(4):
                            total += v[r] * u[c] * points[p, 4 * r + c, d]
                    grid[i, j, d] = total
        at = ends[p] - rate * rate
        for i in range(rate):
            for j in range(rate):
                polygons[at, 0] = grid[i, j]
                polygons[at, 1] = grid[i, j + 1]
                polygons[at, 2] = grid[i + 1, j + 1]
                polygons[at, 3] = grid[i + 1, j]
                at += 1


@kernel
def _bernstein(t: Any, out: Any) -> None:
    s = 1.0 - t
    out[0] = s * s * s
    out[1] = 3.0 * s * s * t
    out[2] = 3.0 * s * t * t
    out[3] = t * t * t
