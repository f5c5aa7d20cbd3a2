"""Our kernels in CUDA on the GPU at hand, timed, beside the model's prediction of the same launches."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.validation.gpu import BUSY, cupy, microseconds, module, spread
from experiments.validation.quantities import TIME, TIME_AIM, warm_microseconds
from models.machine import Machine
from simulator.mix import load_mix
from simulator.scenes import load_scene, read_camera
from simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from simulator.stages.eisenacher2010.bucket_count import BLOCK, bucket_count
from simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from simulator.stages.eisenacher2010.bucket_write import bucket_write
from simulator.stages.eisenacher2010.dice import Grids, dice
from simulator.stages.eisenacher2010.tile_range import TILE_SIZES, Tiles, screen_tiles
from simulator.stages.eisenacher2010.tile_raster import tile_raster

if TYPE_CHECKING:
    import pandas as pd

SCENE, WIDTH, HEIGHT, BOUND = "teapot", 1024, 768, 4.0
SOURCE = "back_end.cu"


def compare_here(machine: Machine, say: Callable[[str], None]) -> "pd.DataFrame":
    """Run bucketing and tile raster at each tile size and sample count; check their pictures; compare times.

    Raises
    ------
    TilestampError
        No CuPy, or no GPU.
    """
    import pandas as pd

    cupy()
    scene = load_scene(SCENE)
    assert scene.patches is not None  # noqa: S101 - the teapot has
    matrix = read_camera("default", scene).matrix(WIDTH, HEIGHT)
    view = (matrix, WIDTH, HEIGHT)
    subpatches, _ = bound_and_split(scene.patches.points, *view, BOUND, machine.simt, counting=False)
    grids, _ = dice(scene.patches.points, subpatches, *view, machine.simt, counting=False)
    rows: list[dict[str, Any]] = []
    for tile in TILE_SIZES:
        say(f"tile {tile}")
        rows += _tile(grids, tile, machine)
    return pd.DataFrame(rows)


def _tile(grids: Grids, tile: int, machine: Machine) -> Iterator[dict[str, Any]]:
    """All kernels at one tile size."""
    cp, simt = cupy(), machine.simt
    mix = load_mix("micropolygon", machine.compute_capability)
    tiles = screen_tiles(WIDTH, HEIGHT, tile, BOUND)
    count, idx, added = bucket_count(grids.boxes, tiles, simt)
    start, _ = bucket_scan(count, simt, counting=False)
    lists, written = bucket_write(grids.boxes, tiles, count, start, idx, simt)
    boxes, vertices = cp.asarray(grids.boxes), cp.asarray(grids.vertices)
    counted, placed = cp.zeros(tiles.total, cp.uint32), cp.zeros((len(grids.boxes), 4), cp.uint32)
    starts, listed = cp.asarray(start), cp.asarray(lists)
    patches = (-(-len(grids.boxes) // BLOCK), BLOCK)
    shape = [np.int32(len(grids.boxes)), np.int32(tiles.columns), np.int32(tiles.rows)]

    def add() -> None:
        counted.fill(0)
        _start("address_calculation", tile, 1, *patches, boxes, *shape, counted, placed)

    fill = microseconds(lambda: counted.fill(0))
    yield _row(tile, 0, "k_addr", microseconds(add) - np.median(fill), mix, added[1], machine)
    places = cp.asarray(idx)
    write = microseconds(lambda: _start("bucket_write", tile, 1, *patches, boxes, *shape, starts, places, listed))
    yield _row(tile, 0, "k_write", write, mix, written[0], machine)
    for spp in (1, 4):
        image, _, _, drawn = tile_raster(grids.vertices, count, start, lists, tiles, WIDTH, HEIGHT, simt, spp=spp)
        pixels, depth = cp.zeros((HEIGHT, WIDTH), cp.uint32), cp.zeros((HEIGHT, WIDTH), cp.float32)
        given = (vertices, starts, cp.asarray(count), listed, *_screen(tiles), pixels, depth)
        draw = partial(_start, "tile_raster", tile, spp, tiles.total, tile * tile, *given)
        times = microseconds(draw)
        yield _row(tile, spp, "k_raster", times, mix, drawn[0], machine)
        channels = cp.asnumpy(pixels).view(np.uint8).reshape(HEIGHT, WIDTH, 4)[:, :, :3]
        different = float((channels != image).any(axis=2).mean())
        yield _entry(tile, spp, "k_raster", "pixels unlike ours", 0.0, different, different, 0.001)


def _screen(tiles: Tiles) -> tuple[Any, ...]:
    return np.int32(tiles.columns), np.int32(WIDTH), np.int32(HEIGHT)


def _start(name: str, tile: int, spp: int, grid: int, block: int, *arguments: Any) -> None:
    """Launch a kernel compiled for a tile size and sample count."""
    side = {1: 1, 4: 2}[spp]
    code = module(SOURCE, (f"-DTILE={tile}", f"-DSIDE={side}"))
    code.get_function(name)((grid,), (block,), arguments)


def _row(tile: int, spp: int, kernel: str, times: Any, mix: Any, work: Any, machine: Machine) -> dict[str, Any]:
    """One time beside ours; a busy GPU shows in the spread."""
    ours = warm_microseconds(mix.launch(work, machine.sm.warp_size), machine)
    measured = float(np.median(times))
    name = kernel + (" (busy GPU?)" if spread(times) > BUSY else "")
    return _entry(tile, spp, name, TIME, ours, measured, ours / measured - 1.0, TIME_AIM)


def _entry(
    tile: int, spp: int, kernel: str, quantity: str, ours: float, measured: float, error: float, aim: float
) -> dict[str, Any]:
    return {
        "scene": SCENE, "W": WIDTH, "tile": tile, "spp": spp, "kernel": kernel, "quantity": quantity,
        "ours": ours, "measured": measured, "error": error, "aim": aim,
    }  # fmt: skip
