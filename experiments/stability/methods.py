"""What the rows of the atlas share: small pictures by each method's own coverage arithmetic, and the exact answer.

Corners are given in pixels, x right and y up, in multiples of 1/65536 pixel on a screen of at most 256 pixels: such a
number is exact in float32 as a pixel coordinate and as a clip coordinate, so whatever differs from the exact coverage
is the method's own rounding, not its input's.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp import Run, simulate
from tilestamp.models.kernel import kernel
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.remembered import remembered
from tilestamp.simulator.reference.coverage import exact_coverage
from tilestamp.simulator.scenes.camera_files import CameraSource
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, covering_triangle, new_setup, set_up
from tilestamp.simulator.stages.ru2016.triangle import area, barycentric, corners, inside, pixel_box
from tilestamp.simulator.stages.zhang2025.fine_tile import coverage

MACHINE = "h200"
STEPS = 65536  # a pixel
TILE = 8
_HALF, _ONE = np.float32(0.5), np.float32(1.0)


class Cover(NamedTuple):
    """What a method covers.

    Parameters
    ----------
    mask : ndarray, (H, W), bool
        Row 0 is the bottom row.
    hits : int
        Covered samples, each triangle's counted.
    """

    mask: NDArray[np.bool_]
    hits: int

    @property
    def doubles(self) -> int:
        """Hits beyond the first at a sample."""
        return self.hits - int(self.mask.sum())


@remembered
def machine() -> Machine:
    """Load the atlas's machine once: it draws hundreds of small pictures."""
    return load_machine(MACHINE)


Method = Callable[[NDArray[np.float64], int], Cover]


def quantized(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round pixel coordinates to what every method gets exactly."""
    rounded: NDArray[np.float64] = np.round(np.asarray(points) * STEPS) / STEPS
    return rounded


def flat_scene(points: NDArray[np.float64], size: int) -> Scene:
    """Make a clip-space scene of triangles (T, 3, 2) in pixels, all at depth 0."""
    flat = np.asarray(points, np.float64).reshape(-1, 2)
    positions = np.zeros((len(flat), 4))
    positions[:, :2] = flat * 2 / size - 1
    positions[:, 3] = 1
    return Scene.from_clip_space(positions, np.arange(len(flat)).reshape(-1, 3))


def exact(points: NDArray[np.float64], size: int) -> Cover:
    """Cover without any rounding."""
    hits = exact_coverage(_downward(points, size), size, size).hits[::-1]
    return Cover(hits > 0, int(hits.sum()))


def _downward(points: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Count y from the top, exactly."""
    return points * [1, -1] + [0, size]


def by_pipeline(pipeline: str, **options: Any) -> Method:
    """Cover by a whole pipeline."""

    def cover(points: NDArray[np.float64], size: int) -> Cover:
        run = draw(flat_scene(points, size), pipeline, size, **options)
        ids = run.triangle_ids
        assert ids is not None  # noqa: S101 - all pipelines of triangles give them
        return Cover(ids[::-1] >= 0, sum(n for name, n in run.counts.items() if name.endswith(".SAMPLE_HITS")))

    return cover


def draw(scene: Scene, pipeline: str, size: int, camera: CameraSource = None, **options: Any) -> Run:
    """Draw a square picture on the atlas's machine."""
    return simulate(scene, pipeline, machine(), width=size, height=size, camera=camera, **options)


def barycentrics(points: NDArray[np.float64], size: int) -> Cover:
    """Cover as ``tiled`` and ``per-primitive`` do: three float32 barycentrics between 0 and 1."""
    screen = _screen(points, size)
    count = np.zeros((size, size), np.int64)
    depth = np.ones((size, size), np.float32)
    barycentric_cover(screen, np.arange(len(screen), dtype=np.int32).reshape(-1, 3), count, depth)
    return Cover(count[::-1] > 0, int(count.sum()))


def edge_planes(points: NDArray[np.float64], size: int) -> Cover:
    """Cover as ``binned`` does: float32 planes a*x + b*y + c over the screen, stepped through 8x8-pixel tiles."""
    return plane_cover(points.astype(np.float32), size)


def plane_cover(p: NDArray[np.float32], size: int) -> Cover:
    """Cover float32 screen triangles (T, 3, 2) as ``binned`` does."""
    a, b, c = p[:, 0], p[:, 1], p[:, 2]
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    p = np.where((signed < 0)[:, None, None], p[:, [0, 2, 1]], p)
    edges = plane_edges(p)
    count = np.zeros((size, size), np.int64)
    for t in np.flatnonzero(signed != 0):
        low, high = (np.clip(v // TILE, 0, size // TILE - 1).astype(int) for v in (p[t].min(axis=0), p[t].max(axis=0)))
        for row in range(low[1], high[1] + 1):
            for column in range(low[0], high[0] + 1):
                mask = int(coverage(edges[t], column * TILE, row * TILE, TILE, TILE))
                bits = np.unpackbits(np.frombuffer(mask.to_bytes(8, "little"), np.uint8), bitorder="little")
                count[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE] += bits.reshape(TILE, TILE)
    return Cover(count > 0, int(count.sum()))


def plane_edges(p: NDArray[np.float32]) -> NDArray[np.float32]:
    """Edge equations (T, 3, 3) of corners (T, 3, 2), as the binned pipeline's triangle setup rounds them."""
    q, r = p[:, [1, 2, 0]], p[:, [2, 0, 1]]
    constant = q[..., 0] * r[..., 1] - r[..., 0] * q[..., 1]
    return np.stack([q[..., 1] - r[..., 1], r[..., 0] - q[..., 0], constant], axis=-1)


def stamp(points: NDArray[np.float64], size: int) -> Cover:
    """Cover as ``stamps``, ``across-polygons`` and ``bit-mask`` do: whole numbers of 1/4096 pixel."""
    count = np.zeros((size, size), np.int64)
    polygons = np.zeros((len(points), 3, 3), np.float32)
    polygons[..., :2] = _downward(points, size)
    stamp_cover(polygons, *new_setup(), count)
    return Cover(count[::-1] > 0, int(count.sum()))


def quads(points: NDArray[np.float64], size: int) -> Cover:
    """Cover as ``micropolygon`` does: four float32 edge functions of a quad, whose last corner is doubled here."""
    vertices = np.zeros((len(points), 16, 2))
    vertices[:] = points[:, 2:, :]
    vertices[:, 0], vertices[:, 1] = points[:, 0], points[:, 1]
    return _grid_cover(vertices, size)


def quad_lattice(lattice: NDArray[np.float64], size: int) -> Cover:
    """Cover the quads between points (R, C, 2) as ``micropolygon`` does, 3 x 3 a grid."""
    rows, columns = (lattice.shape[k] // 3 for k in (0, 1))
    grids = [lattice[3 * j : 3 * j + 4, 3 * i : 3 * i + 4] for j in range(rows) for i in range(columns)]
    return _grid_cover(np.stack(grids).reshape(-1, 16, 2), size)


def _grid_cover(corners: NDArray[np.float64], size: int) -> Cover:
    """Draw grids (N, 16, 2), each listed in every tile."""
    tiles = screen_tiles(size, size, TILE, 4)
    vertices = np.zeros((len(corners), 16, 4), np.float32)
    vertices[..., :2] = _downward(corners, size)
    count = np.full(tiles.total, len(corners), np.uint32)
    lists = np.tile(np.arange(len(corners), dtype=np.uint32), tiles.total)
    start = (np.arange(tiles.total) * len(corners)).astype(np.uint32)
    simt = machine().simt
    (_, depth, overdraw), _, _ = tile_raster(vertices, count, start, lists, tiles, size, size, simt)
    assert overdraw is not None  # noqa: S101 - counting is on
    return Cover(depth[::-1] < 1, int(overdraw.sum()))


def _screen(points: NDArray[np.float64], size: int) -> NDArray[np.float32]:
    """Corners as Ru's vertex shading leaves them: pixels right and down, depth, 1/w."""
    screen = np.full((points.size // 2, 4), _HALF)
    screen[:, :2] = _downward(points, size).reshape(-1, 2)
    return screen


@kernel(error_model="numpy")
def barycentric_cover(screen: Any, triangles: Any, count: Any, depth: Any) -> None:
    """Count the triangles of each pixel, (H, W) from the top, and keep the least depth of each.

    ``screen`` is as Ru's vertex shading leaves it, and ``depth`` is cleared to 1.
    """
    for t in range(len(triangles)):
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        twice = area(x0, y0, x1, y1, x2, y2)
        if twice == np.float32(0.0):
            continue
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, count.shape[1], count.shape[0])
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                a, b, c = barycentric(
                    x0, y0, x1, y1, x2, y2, _ONE / twice, np.float32(x) + _HALF, np.float32(y) + _HALF
                )
                z = a * screen[triangles[t, 0], 2] + b * screen[triangles[t, 1], 2] + c * screen[triangles[t, 2], 2]
                if inside(a, b, c) and z >= np.float32(0.0) and z < _ONE:
                    count[y, x] += 1
                    depth[y, x] = min(depth[y, x], z)


@kernel
def stamp_cover(polygons: Any, edges: Any, boxes: Any, depths: Any, snapped: Any, count: Any) -> None:
    """Count the polygons of each pixel, (H, W) from the top; ``new_setup`` gives the scratch."""
    for p in range(len(polygons)):
        set_up(polygons[p], edges, boxes, depths, snapped)
        for y in range(max(boxes[0, 1] // STEP, 0), min(boxes[0, 3] // STEP + 1, count.shape[0])):
            for x in range(max(boxes[0, 0] // STEP, 0), min(boxes[0, 2] // STEP + 1, count.shape[1])):
                count[y, x] += covering_triangle(edges, x * STEP + STEP // 2, y * STEP + STEP // 2) >= 0


QUADS = "micropolygon: float32 edges of a quad"
METHODS: dict[str, Method] = {
    "cudaraster, freepipe: 1/16 pixel": by_pipeline("cudaraster", cull_backfaces=False, mode="color"),
    "hardware: 1/256 pixel": by_pipeline("hardware", cull_backfaces=False),
    "stamps: 1/4096 pixel": stamp,
    "tiled, per-primitive: float32 barycentrics": barycentrics,
    "binned: float32 edge planes": edge_planes,
    QUADS: quads,
}
