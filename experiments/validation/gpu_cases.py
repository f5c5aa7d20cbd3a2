"""Our kernels in CUDA on the GPU at hand: what to launch, what it must leave, and the work that our stage counted."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import cupy, module
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import BLOCK, bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import TILE_SIZES, Tiles, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup
from tilestamp.simulator.stages.liu2010.freepipe import freepipe
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh
from tilestamp.simulator.work import Work

SCENE, WIDTH, HEIGHT, BOUND = "teapot", 1024, 768, 4.0
BACK_END, TRIANGLES = "back_end.cu", "triangles.cu"
NEEDED_BYTES = 1 << 30  # device memory, with room to spare


@dataclass(frozen=True)
class GpuCase:
    """One kernel on the GPU at hand.

    Parameters
    ----------
    tile, spp : int
        0 where the kernel has none.
    kernel : str
        As the measurements call it.
    pipeline : str
        Whose mix prices it.
    work : Work
        What our stage counted.
    start : callable
        Launches the kernel once.
    reset : callable or None
        Restores what the kernel changes, on the GPU.
    unlike : callable
        Share of the results that differ from our stage's, after one launch.
    """

    tile: int
    spp: int
    kernel: str
    pipeline: str
    work: Work
    start: Callable[[], None]
    reset: Callable[[], None] | None
    unlike: Callable[[], float]


def gpu_cases(simt: Simt, say: Callable[[str], None]) -> Iterator[GpuCase]:
    """All kernels, one after another: bucketing and tile raster at each tile size, then triangles.

    Raises
    ------
    TilestampError
        No CuPy, no GPU, or too little memory on it.
    """
    free = int(cupy().cuda.runtime.memGetInfo()[0])
    if free < NEEDED_BYTES:
        raise TilestampError(f"the GPU has {free >> 20} MiB free and this needs {NEEDED_BYTES >> 20}: is it in use?")
    grids = _teapot_grids(simt)
    for tile in TILE_SIZES:
        say(f"tile size {tile}")
        yield from _back_end(grids, tile, simt)
    say("triangles")
    yield from _triangles(simt)


def _teapot_grids(simt: Simt) -> Grids:
    scene = load_scene(SCENE)
    assert scene.patches is not None  # noqa: S101 - the teapot has
    view = (read_camera("default", scene).matrix(WIDTH, HEIGHT), WIDTH, HEIGHT)
    subpatches, _, _ = bound_and_split(scene.patches.points, *view, BOUND, simt, counting=False)
    return dice(scene.patches.points, subpatches, *view, simt, counting=False)[0]


def _back_end(grids: Grids, tile: int, simt: Simt) -> Iterator[GpuCase]:
    """Address calculation, bucket write and both rasters at one tile size."""
    cp = cupy()
    tiles = screen_tiles(WIDTH, HEIGHT, tile, BOUND)
    (count, idx), added, _ = bucket_count(grids.boxes, tiles, simt)
    start, _, _ = bucket_scan(count, simt, counting=False)
    lists, written, _ = bucket_write(grids.boxes, tiles, count, start, idx, simt)
    shape = (np.int32(len(grids.boxes)), np.int32(tiles.columns), np.int32(tiles.rows))
    boxes, vertices, starts, counts = map(cp.asarray, (grids.boxes, grids.vertices, start, count))
    counted, placed = cp.zeros(tiles.total, cp.uint32), cp.zeros((len(grids.boxes), 4), cp.uint32)
    listed = cp.zeros(len(lists), cp.uint32)
    code, grid = partial(_code, tile, 1), -(-len(grids.boxes) // BLOCK)
    add = _launcher(code, "address_calculation", grid, BLOCK, boxes, *shape, counted, placed)
    yield GpuCase(
        tile, 0, "k_addr", "micropolygon", added[1], add, partial(counted.fill, 0), partial(_unlike, counted, count)
    )
    places = cp.asarray(idx)
    write = _launcher(code, "bucket_write", grid, BLOCK, boxes, *shape, starts, places, listed)
    yield GpuCase(tile, 0, "k_write", "micropolygon", written[0], write, None, partial(_unlike, listed, lists))
    for spp in (1, 4):
        (image, _, _), drawn, _ = tile_raster(grids.vertices, count, start, lists, tiles, WIDTH, HEIGHT, simt, spp=spp)
        yield _raster_case(tiles, tile, spp, drawn[0], image, (vertices, starts, counts, cp.asarray(lists)))


def _raster_case(
    tiles: Tiles, tile: int, spp: int, work: Work, image: NDArray[Any], buffers: tuple[Any, ...]
) -> GpuCase:
    cp = cupy()
    pixels, depth = cp.zeros((HEIGHT, WIDTH), cp.uint32), cp.zeros((HEIGHT, WIDTH), cp.float32)
    screen = (np.int32(tiles.columns), np.int32(WIDTH), np.int32(HEIGHT))
    arguments = (*buffers, *screen, pixels, depth)
    draw = _launcher(partial(_code, tile, spp), "tile_raster", tiles.total, tile * tile, *arguments)

    def unlike() -> float:
        channels = cp.asnumpy(pixels).view(np.uint8).reshape(HEIGHT, WIDTH, 4)[:, :, :3]
        return float((channels != image).any(axis=2).mean())

    return GpuCase(tile, spp, "k_raster", "micropolygon", work, draw, None, unlike)


def _triangles(simt: Simt) -> Iterator[GpuCase]:
    """FreePipe, blind and reading first, and triangle setup, of the tessellated teapot."""
    cp = cupy()
    scene = load_scene(SCENE)
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, read_camera("default", scene).matrix(WIDTH, HEIGHT))
    n, size = len(mesh.triangles), (np.int32(WIDTH), np.int32(HEIGHT))
    inputs = (cp.asarray(positions), cp.asarray(mesh.triangles), np.int32(n), *size)
    clipped, frame = cp.zeros(1, cp.uint32), cp.zeros((HEIGHT, WIDTH), cp.uint64)
    for kernel in ("freepipe", "freepipe_early"):
        drawn, works, _ = freepipe(positions, mesh.triangles, WIDTH, HEIGHT, simt, early=kernel == "freepipe_early")
        work = works[0]
        start = _launcher(_triangle_code, kernel, work.grid, work.block, *inputs, frame, clipped)
        ids = (drawn.ids + 1).astype(np.uint32)
        unlike = partial(_unlike_low, frame, ids, clipped)
        yield GpuCase(0, 0, kernel, "freepipe", work, start, partial(frame.fill, 2**64 - 1), unlike)
    setup, (work,), _ = triangle_setup(positions, mesh.triangles, WIDTH, HEIGHT, simt, release="nvdiffrast")
    kept, headers, planes = cp.zeros(n, cp.uint8), cp.zeros((n, 4), cp.uint32), cp.zeros((n, 4), cp.uint32)
    start = _launcher(_triangle_code, "triangle_setup", work.grid, work.block, *inputs, kept, headers, planes, clipped)

    def different() -> float:
        seen = setup.subtriangles > 0
        records = setup.planes[np.where(seen, setup.records[:n], 0)]
        ours = np.concatenate([setup.headers[:n].view(np.uint32), setup.misc[:n, None], records], axis=1)
        theirs = np.concatenate([cp.asnumpy(headers), cp.asnumpy(planes)], axis=1)
        wrong = (cp.asnumpy(kept) != setup.subtriangles) | (seen & (ours != theirs).any(axis=1))
        return float(wrong.mean()) + float(clipped[0])

    yield GpuCase(0, 0, "triangleSetup", "cudaraster", work, start, None, different)


def _code(tile: int, spp: int) -> Any:
    return module(BACK_END, (f"-DTILE={tile}", f"-DSIDE={ {1: 1, 4: 2}[spp] }"))


def _triangle_code() -> Any:
    return module(TRIANGLES)


def _launcher(code: Callable[[], Any], name: str, grid: int, block: int, *arguments: Any) -> Callable[[], None]:
    """Launch of one kernel; compiled when it first runs."""
    return lambda: code().get_function(name)((grid,), (block,), arguments)


def _unlike(theirs: Any, ours: NDArray[Any]) -> float:
    """Share of places that differ; what a tile lists may come in another order."""
    here = cupy().asnumpy(theirs)
    return float((np.sort(here) != np.sort(ours)).mean()) if here.size else 0.0


def _unlike_low(frame: Any, ids: NDArray[np.uint32], clipped: Any) -> float:
    """Share of pixels with another triangle; a triangle that had to be clipped is a failure of its own."""
    low = (cupy().asnumpy(frame) & np.uint64(0xFFFFFFFF)).astype(np.uint32)
    low[low == 0xFFFFFFFF] = 0
    return float((low != ids).mean()) + float(clipped[0])
