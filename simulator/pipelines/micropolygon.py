"""Data-parallel micropolygon rasterization (Eisenacher & Loop 2010): the overview of section 3, stage by stage.

Bound and split patches until they are small on screen; dice them into 4x4 grids; sort the grids into the buckets of
screen tiles by count, scan and write; rasterize each tile. In the hybrid the grids go to the fixed-function rasterizer
instead of the buckets.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygon_hybrid import draw_grids
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.eisenacher2010 import snap_edges as snapping
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import BoundRule, SubPatches, bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent
from tilestamp.simulator.work import Work


def micropolygon(
    scene: Scene,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    execute: Executor,
    *,
    tile: int = 8,
    spp: int = 1,
    bound: float = 4,
    bound_rule: BoundRule = "control_points",
    box_tests: bool = True,
    edges: Literal["computed", "loaded"] = "computed",
    near: float = 0.0,
    min_depth: int = 0,
    snap_edges: bool = False,
    hybrid: bool = False,
    texture: NDArray[np.uint8] | None = None,
) -> Frame:
    """Micropolygons from patches: split, dice, bucket, rasterize tiles (Eisenacher & Loop 2010).

    Parameters
    ----------
    scene : Scene
        With patches.
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    width, height : int
        Pixels.
    simt : Simt
    execute : Executor
    tile : int
        Pixels a side of a screen tile: 4, 8, 16 or 32.
    spp : int
        Samples a pixel: 1, 4 or 16.
    bound : float
        Pixels that a sub-patch may be wide and high on screen.
    bound_rule : {"control_points", "pixel_extent"}
        How that is measured; see ``bound_and_split``.
    box_tests : bool
        Test boxes before edge functions.
    edges : {"computed", "loaded"}
        Edge equations computed by each thread, or computed while dicing and loaded.
    near : float
        Sub-patches wholly nearer to the eye's plane than this are culled, so that splitting across it ends (not in the
        paper).
    min_depth : int
        Halvings that every sub-patch takes; as many as the deepest needs leave no cracks.
    snap_edges : bool
        Put the vertices of finer sub-patches on the edges of their coarser neighbours, so that there are no cracks
        (not in the paper). Its look-ups are counted and not priced.
    hybrid : bool
        Give the diced grids to the fixed-function rasterizer.
    texture : ndarray, (H, W, 3 or 4), uint8, optional
        Laid over each patch.

    Returns
    -------
    Frame
        Maps a tile: quads, tests, ste, atomics; a pixel: overdraw.

    Raises
    ------
    TilestampError
        A scene without patches, or options that a stage does not have.
    """
    if scene.patches is None:
        raise TilestampError(f"the pipeline micropolygon draws patches, and {scene.name} has none")
    if texture is not None and not isinstance(texture, np.ndarray):
        raise TilestampError(f"texture must be an array of (H, W, 3 or 4) bytes, not {texture!r}")
    points = scene.patches.points
    textured = texture is not None
    view: dict[str, Any] = {"matrix": matrix, "width": width, "height": height, "simt": simt}
    tiles = screen_tiles(width, height, tile, bound)
    subpatches = execute(
        bound_and_split, points, **view, bound=bound, bound_rule=bound_rule, near=near, min_depth=min_depth
    ).outputs
    grids = execute(dice, points, subpatches, **view, texture=texture, shaded=execute.picture).outputs
    if snap_edges:
        grids = execute(snapping.snap_edges, points, subpatches, grids, simt, textured=textured).outputs.grids
    if hybrid:
        return draw_grids(execute, grids, width, height, _facts(subpatches, 0))
    count, idx = execute(bucket_count, grids.boxes, tiles, simt).outputs
    start = execute(bucket_scan, count, simt).outputs
    lists = execute(bucket_write, grids.boxes, tiles, count, start, idx, simt).outputs
    pixels, drawn, _ = execute.last(
        tile_raster, grids.vertices, count, start, lists, tiles, width, height, simt,
        spp=spp, box_tests=box_tests, edges=edges,
    )  # fmt: skip
    facts = _facts(subpatches, len(lists))
    if not execute.picture:
        return Frame.numbers(execute.works, facts)
    maps = {} if pixels.overdraw is None else _maps(drawn[0], count, pixels.overdraw, tiles)
    return Frame(pixels.image, pixels.depth, execute.works, maps=maps, facts=facts, tile=tile)


def _maps(
    raster: Work, count: NDArray[np.uint32], overdraw: NDArray[np.int32], tiles: Tiles
) -> dict[str, NDArray[Any]]:
    """Heat maps: a cell a tile, and overdraw a cell a pixel."""
    shape = (tiles.rows, tiles.columns)
    tests = raster.table[:, TileRasterEvent.SAMPLE_TESTS].reshape(shape)
    hits = raster.table[:, TileRasterEvent.SAMPLE_HITS].reshape(shape)
    quads = raster.table[:, TileRasterEvent.SUBTILE_PASS].reshape(shape)
    atomics = count.astype(np.int64).reshape(shape)
    return {
        "quads": quads,
        "tests": tests,
        "ste": hits / np.maximum(tests, 1),
        "overdraw": overdraw,
        "atomics": atomics,
    }


def _facts(subpatches: SubPatches, written: int) -> dict[str, Any]:
    """Tell what a report may say besides."""
    return {
        "subpatches": len(subpatches.patch),
        "patches_written": written,
        "queue_passes": subpatches.passes.tolist(),
        "given_up": int(subpatches.passes[:, -1].sum()),
    }
