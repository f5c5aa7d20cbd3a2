"""Data-parallel micropolygon rasterization (Eisenacher & Loop 2010): the overview of section 3, stage by stage.

Bound and split patches until they are small on screen; dice them into 4x4 grids; sort the grids into the buckets of
screen tiles by count, scan and write; rasterize each tile. In the hybrid the grids go to the fixed-function rasterizer
instead of the buckets.
"""

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.pipelines._micropolygon_hybrid import draw_grids
from tilestamp.simulator.pipelines._micropolygon_sampled import sampled_back_end
from tilestamp.simulator.sampler import Sampler
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.eisenacher2010 import snap_edges as snapping
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import (
    MAX_DEPTH,
    BoundRule,
    SubPatches,
    bound_and_split,
)
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, TileSize, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Edges, raster_work, tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent, block_shape
from tilestamp.simulator.work import Work

REMARKS = {
    "given_up": "{:,} sub-patches were still large, or across the eye's plane, at the last halving and are not drawn"
}


class MicropolygonOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline micropolygon."""

    tile: TileSize = 8
    """Pixels on a side of a screen tile."""
    spp: Literal[1, 4, 16] = 1
    """Samples a pixel."""
    bound: Annotated[float, Meta(gt=0, le=4096)] = 4.0
    """Pixels that a sub-patch may be wide and high on screen."""
    bound_rule: BoundRule = "control_points"
    """How that is measured: on control points, or as whole pixels, the reading that matches the paper's counts."""
    box_tests: bool = True
    """Test boxes before edge functions."""
    edges: Edges = "computed"
    """Edge equations computed by each thread, or computed while dicing and loaded."""
    near: Annotated[float, Meta(ge=0)] = 0.0
    """Sub-patches wholly nearer to the eye's plane are culled, so that splitting across it ends (not in the paper)."""
    min_depth: Annotated[int, Meta(ge=0, le=MAX_DEPTH)] = 0
    """Halvings that every sub-patch takes; as many as the deepest needs leave no cracks."""
    snap_edges: bool = False
    """Put the vertices of finer sub-patches on the edges of their coarser neighbours, so that there are no cracks (not
    in the paper). Its look-ups are counted and not priced. A sampled run then samples bound and split alone."""
    hybrid: bool = False
    """Give the diced grids to the fixed-function rasterizer."""
    texture: NDArray[np.uint8] | None = None
    """Laid over each patch: (H, W, 3 or 4) bytes."""
    counting: bool = True
    """Count what the machine does; without it there is a picture and no time."""

    def launches(self, simt: Simt) -> list[Work]:
        """Tile raster has a thread a pixel of a tile, and its samples in shared memory."""
        shape = block_shape(self.tile, self.spp, simt, box_tests=self.box_tests, loaded=self.edges == "loaded")
        return [] if self.hybrid else [raster_work(shape, np.zeros((0, len(TileRasterEvent)), np.int64))]


def micropolygon(
    scene: Scene,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    options: MicropolygonOptions,
    *,
    sample: Sampler | None = None,
    picture: bool = True,
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
    options : MicropolygonOptions
    sample : Sampler, optional
        Run part of the units; no picture comes back.
    picture : bool
        Without it vertices are not shaded, and no picture comes back.

    Returns
    -------
    Frame
        Maps a tile: quads, tests, ste, atomics; a pixel: overdraw.

    Raises
    ------
    TilestampError
        A scene without patches.
    """
    if scene.patches is None:
        raise TilestampError(f"the pipeline micropolygon draws patches, and {scene.name} has none")
    points, texture, counting = scene.patches.points, options.texture, options.counting
    tiles = screen_tiles(width, height, options.tile, options.bound)
    boxes: list[NDArray[np.float32]] | None = [] if sample and not options.hybrid and not options.snap_edges else None
    subpatches, split = bound_and_split(
        points, matrix, width, height, options.bound, simt, bound_rule=options.bound_rule, counting=counting,
        near=options.near, min_depth=options.min_depth, wanted=boxes, sample=sample,
    )  # fmt: skip
    raster: dict[str, Any] = {"spp": options.spp, "box_tests": options.box_tests, "edges": options.edges}
    if sample and boxes and sample.pays(len(subpatches.patch)):
        view = matrix, width, height, simt
        rest = sampled_back_end(
            sample, points, subpatches, boxes[0], view, tiles, textured=texture is not None, raster=raster
        )
        facts = _facts(subpatches, rest[-1].total(TileRasterEvent.GRIDS))
        return Frame.numbers([*split, *rest], facts, remarks(REMARKS, facts))
    grids, diced = dice(
        points, subpatches, matrix, width, height, simt, texture=texture, counting=counting, shaded=picture
    )
    if options.snap_edges:
        snapped = snapping.snap_edges(subpatches, grids, snapping.shared_edges(points))
        grids = snapped.grids
        if counting:
            diced += snapping.snap_works(snapped, subpatches.patch, len(points), simt, textured=texture is not None)
    if options.hybrid:
        drawn_grids = draw_grids(grids, width, height, [*split, *diced], _facts(subpatches, 0))
        return replace(drawn_grids, warnings=remarks(REMARKS, drawn_grids.facts))
    count, idx, counted = bucket_count(grids.boxes, tiles, simt, counting=counting)
    start, scanned = bucket_scan(count, simt, counting=counting)
    lists, written = bucket_write(grids.boxes, tiles, count, start, idx, simt, counting=counting)
    image, depth, overdraw, drawn = tile_raster(
        grids.vertices, count, start, lists, tiles, width, height, simt, **raster, counting=counting
    )
    works = [*split, *diced, *counted, *scanned, *written, *drawn]
    maps = {} if overdraw is None else _maps(drawn[0], count, overdraw, tiles)
    facts = _facts(subpatches, len(lists))
    if not picture:
        return Frame.numbers(works, facts, remarks(REMARKS, facts))
    warnings = remarks(REMARKS, facts)
    return Frame(image, depth, works, maps=maps, facts=facts, warnings=warnings, tile=options.tile)


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
