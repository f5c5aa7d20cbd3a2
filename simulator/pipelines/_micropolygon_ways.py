"""Ways to dice and to rasterize tiles in the pipeline micropolygon: the published ones, and the roads not taken."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines._micropolygon_options import MicropolygonOptions
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.culled_raster import culled_raster, dice_nearest
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.displace import dice_displaced
from tilestamp.simulator.stages.eisenacher2010.link_grids import link_grids
from tilestamp.simulator.stages.eisenacher2010.macro_raster import macro_raster
from tilestamp.simulator.stages.eisenacher2010.shade_visible import dice_positions
from tilestamp.simulator.stages.eisenacher2010.shared_vertices import dice_shared
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Pixels, tile_raster
from tilestamp.simulator.work import Work

Buckets = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32]]  # COUNT, START, LISTS


def diced(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    view: dict[str, Any],
    options: MicropolygonOptions,
    execute: Executor,
) -> tuple[Grids, Mapping[str, Any]]:
    """Dice by the way of shading; grids, and how many vertices were shaded."""
    side, shaded = options.grid, len(subpatches.patch) * options.grid**2
    how: dict[str, Any] = {"texture": options.texture, "shaded": execute.picture}
    if options.shading == "visible":
        return execute(dice_positions, points, subpatches, **view, side=side).outputs, {}
    if options.shading == "shared":
        links = execute(link_grids, subpatches, view["simt"]).outputs
        grids, _, facts = execute(dice_shared, points, subpatches, links, **view, **how, side=side)
        return grids, facts
    if options.relief is not None:
        relief: dict[str, Any] = {"relief": options.relief, "relief_height": options.relief_height}
        grids, _, widest = execute(dice_displaced, points, subpatches, **view, **how, **relief)
        return grids, {"shaded_vertices": shaded, **widest}
    if options.cull != "none":
        return execute(dice_nearest, points, subpatches, **view, **how).outputs, {"shaded_vertices": shaded}
    grids = execute(dice, points, subpatches, **view, **how, side=side).outputs
    return grids, {"shaded_vertices": shaded}


def rasterized(
    grids: Grids,
    buckets: Buckets,
    tiles: tuple[Tiles, Tiles],
    size: tuple[int, int],
    simt: Simt,
    options: MicropolygonOptions,
    execute: Executor,
) -> tuple[Pixels, tuple[Work, ...]]:
    """Rasterize tiles: as published, behind what they show passed over, or fine tiles in coarse ones."""
    listed, fine = tiles
    if options.has_masks:
        pixels, works, _ = execute(macro_raster, grids.vertices, grids.boxes, *buckets, listed, fine, *size, simt)
    elif options.cull != "none":
        by_depth = options.cull == "sorted"
        pixels, works, _ = execute(culled_raster, grids.vertices, *buckets, listed, *size, simt, by_depth=by_depth)
    else:
        pixels, works, _ = execute(
            tile_raster, grids.vertices, *buckets, listed, *size, simt,
            spp=options.spp, box_tests=options.box_tests, edges=options.edges, ids=options.shading == "visible",
        )  # fmt: skip
    return pixels, works
