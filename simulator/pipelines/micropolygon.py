"""Data-parallel micropolygon rasterization (Eisenacher & Loop 2010): the overview of section 3, stage by stage.

Bound and split patches until they are small on screen; dice them into 4x4 grids; sort the grids into the buckets of
screen tiles by count, scan and write; rasterize each tile. In the hybrid the grids go to the fixed-function rasterizer
instead of the buckets.

Modelled
--------
- The published kernels of each pass: blocks, batches, queues, the scan in two levels, lists in the order of the
  atomics.
- Tile raster with and without box tests, with edges computed or loaded, at 1, 4 and 16 samples.
- Lanes of a warp that want one counter, and requests that queue at the unit of L2 or the lock of DRAM that owns it.
- A texture over each patch, and cures of cracks that the paper has not (``snap_edges``, ``min_depth``).
- Roads that the paper leaves for later: larger grids, vertices shared by neighbours, shading after visibility; tiles
  in two scales; grids culled behind what a tile shows.

Not modelled
------------
- A host that reads the size of each queue: passes follow one another at the machine's launch overhead.
- The order in which atomics of different warps arrive: lists keep the order of blocks, so neighbours write closer
  together.
- The paper's system overhead (4.6 ms of a frame): the experiments add it, not the pipeline.
- Motion blur and transparency, of which the paper has none. Displaced grids are lit as if they were not displaced.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.pipelines._micropolygon_hybrid import draw_grids
from tilestamp.simulator.pipelines._micropolygon_options import MicropolygonOptions
from tilestamp.simulator.pipelines._micropolygon_ways import diced, rasterized
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import (
    SubPatches,
    bound_and_split,
)
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.displace import padded
from tilestamp.simulator.stages.eisenacher2010.edge_equations import snap_vertices
from tilestamp.simulator.stages.eisenacher2010.refine_buckets import refine_buckets
from tilestamp.simulator.stages.eisenacher2010.shade_visible import shade_visible
from tilestamp.simulator.stages.eisenacher2010.snap_edges import snap_edges
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent
from tilestamp.simulator.work import Work

REMARKS = {
    "given_up": "{:,} sub-patches were still large, or across the eye's plane, at the last halving and are not drawn"
}


def micropolygon(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: MicropolygonOptions, execute: Executor
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
    execute : Executor

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
    points, texture = scene.patches.points, options.texture
    view: dict[str, Any] = {"matrix": matrix, "width": width, "height": height, "simt": simt}
    fine = screen_tiles(width, height, options.tile, options.bound)
    tiles = screen_tiles(width, height, options.coarse, options.bound) if options.coarse else fine
    split, bound = view, options.bound
    if options.relief is not None:
        room = padded(points, matrix, width, height, bound, options.relief_height)
        bound, split = room.bound, view | {"matrix": room.matrix, "width": room.width, "height": room.height}
    subpatches = execute(
        bound_and_split, points, **split, bound=bound, bound_rule=options.bound_rule, near=options.near,
        min_depth=options.min_depth,
    ).outputs  # fmt: skip
    grids, shaded = diced(points, subpatches, view, options, execute)
    if options.edges == "snapped":
        grids = snap_vertices(grids, options.bound)
    if options.snap_edges:
        grids = execute(snap_edges, points, subpatches, grids, simt, textured=texture is not None).outputs.grids
    if options.hybrid:
        frame = draw_grids(execute, grids, width, height, _facts(subpatches, 0))
        return replace(frame, warnings=remarks(REMARKS, frame.facts))
    count, idx = execute(bucket_count, grids.boxes, tiles, simt).outputs
    start = execute(bucket_scan, count, simt).outputs
    lists = execute(bucket_write, grids.boxes, tiles, count, start, idx, simt).outputs
    if options.coarse and not options.has_masks:
        count, start, lists = execute(refine_buckets, grids.boxes, count, start, lists, tiles, fine, simt).outputs
        tiles = fine
    pixels, drawn = rasterized(grids, (count, start, lists), (tiles, fine), (width, height), simt, options, execute)
    image = pixels.image
    if options.shading == "visible":
        late: dict[str, Any] = {"side": options.grid, "texture": texture}
        image, _, shaded = execute(shade_visible, points, subpatches, grids, image, matrix, simt, **late)
    facts = {**_facts(subpatches, len(lists)), **shaded}
    said = remarks(REMARKS, facts)
    if not execute.picture:
        return Frame.numbers(execute.works, facts, said)
    maps = {} if pixels.overdraw is None else _maps(drawn[0], count, pixels.overdraw, tiles)
    return Frame(image, pixels.depth, execute.works, maps=maps, facts=facts, warnings=said, tile=tiles.size)


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
