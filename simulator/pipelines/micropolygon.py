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

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.pipelines._micropolygon_hybrid import draw_grids
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import (
    MAX_DEPTH,
    BoundRule,
    SubPatches,
    bound_and_split,
)
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.culled_raster import Cull, culled_raster, dice_nearest
from tilestamp.simulator.stages.eisenacher2010.dice import GRID_SIDE, Grids, dice
from tilestamp.simulator.stages.eisenacher2010.displace import dice_displaced, padded
from tilestamp.simulator.stages.eisenacher2010.edge_equations import snap_vertices
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide
from tilestamp.simulator.stages.eisenacher2010.link_grids import link_grids
from tilestamp.simulator.stages.eisenacher2010.macro_raster import macro_raster
from tilestamp.simulator.stages.eisenacher2010.refine_buckets import refine_buckets
from tilestamp.simulator.stages.eisenacher2010.shade_visible import dice_positions, shade_visible
from tilestamp.simulator.stages.eisenacher2010.shared_vertices import dice_shared
from tilestamp.simulator.stages.eisenacher2010.snap_edges import snap_edges
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, TileSize, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Edges, raster_work, tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import SHORT, TileRasterEvent, block_shape
from tilestamp.simulator.work import Work

LARGEST_CULLED = 16  # pixels a side of a tile whose grids are culled
FINE = 8  # pixels a side of a fine tile at most, where warps have one each
REMARKS = {
    "given_up": "{:,} sub-patches were still large, or across the eye's plane, at the last halving and are not drawn"
}


class MicropolygonOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline micropolygon."""

    maps: ClassVar[dict[str, str]] = {
        "quads": "pairs of a micropolygon and a sub-tile of a tile that pass the box test",
        "tests": "sample tests in a tile",
        "ste": "sample test efficiency in a tile",
        "overdraw": "micropolygons that cover a pixel",
        "atomics": "micropolygons that are put into a tile's bucket, an atomic each",
    }
    patches: ClassVar[bool] = True
    tile: TileSize = 8
    """Pixels on a side of a screen tile."""
    spp: Literal[1, 4, 16] = 1
    """Samples a pixel."""
    bound: Annotated[float, Meta(gt=0, le=4096)] = 4.0
    """Pixels that a sub-patch may be wide and high on screen."""
    bound_rule: BoundRule = "control_points"
    """How a sub-patch is measured: on control points, or as whole pixels, which matches the paper's counts."""
    box_tests: bool = True
    """Test boxes before edge functions."""
    edges: Edges = "computed"
    """Edge equations computed by each thread, or computed while dicing and loaded; in 16 bits as halves, as whole
    numbers, or of snapped vertices (which the paper has not)."""
    near: Annotated[float, Meta(ge=0)] = 0.0
    """Sub-patches wholly nearer to the eye's plane are culled, so that splitting across it ends (not in the paper)."""
    min_depth: Annotated[int, Meta(ge=0, le=MAX_DEPTH)] = 0
    """Halvings that every sub-patch takes; as many as the deepest needs leave no cracks."""
    snap_edges: bool = False
    """Put the vertices of finer sub-patches on the edges of their coarser neighbours, so that there are no cracks (not
    in the paper). Its look-ups are counted and not priced."""
    grid: GridSide = 4
    """Vertices on a side of a grid; with more, a bound that is larger keeps quads as they are (not in the paper)."""
    shading: Literal["vertices", "shared", "visible"] = "vertices"
    """Vertices of each grid by itself, each vertex that neighbours share once, or grids that are seen (the last two are
    not in the paper)."""
    coarse: Literal[16, 32] | None = None
    """Pixels on a side of coarse tiles that grids are put into first; then into tiles in them (not in the paper)."""
    second_level: Literal["masks", "buckets"] = "masks"
    """How fine tiles get their grids of coarse ones: by masks in shared memory, or by a second bucket pass."""
    cull: Cull = "none"
    """Pass over grids behind what a tile shows already, in the order of the list or sorted front to back (not in the
    paper)."""
    hybrid: bool = False
    """Give the diced grids to the fixed-function rasterizer."""
    relief: NDArray[np.uint8] | None = None
    """Displacement map laid over each patch: (H, W) bytes (not in the paper). Bounds leave room for it."""
    relief_height: Annotated[float, Meta(ge=0)] = 0.0
    """Units of the model that white in the relief moves a vertex along its normal."""
    texture: NDArray[np.uint8] | None = None
    """Laid over each patch: (H, W, 3 or 4) bytes."""

    def __post_init__(self) -> None:
        """Refuse what larger grids and late shading do not go with."""
        super().__post_init__()
        if self.grid > GRID_SIDE and (self.hybrid or self.snap_edges or self.edges != "computed"):
            raise TilestampError("grid: hybrid, snap_edges and loaded edges take grids of 4x4 vertices only")
        if self.shading != "vertices" and (self.hybrid or self.snap_edges):
            raise TilestampError("shading: hybrid and snap_edges shade the vertices of each grid by itself")
        if self.shading == "visible" and (self.spp > 1 or not self.box_tests):
            raise TilestampError("shading what is visible is written for one sample a pixel, with box tests")
        if self.edges in SHORT and (
            self.tile > FINE or self.spp > 1 or not self.box_tests or self.shading == "visible"
        ):
            raise TilestampError("edges of 16 bits: tiles of 4 or 8, one sample a pixel, box tests, shaded before")
        roads = self.grid > GRID_SIDE or self.shading != "vertices" or self.cull != "none" or self.snap_edges
        if self.relief is not None and (roads or self.bound_rule != "control_points"):
            raise TilestampError("relief: shading vertices, bound_rule control_points, grid 4, no cull, no snap_edges")
        if self.coarse and (self.coarse <= self.tile or self.hybrid):
            raise TilestampError("coarse tiles are larger than tiles, and not for the hybrid")
        if self.has_masks and (self.tile > FINE or self.spp > 1 or not self.box_tests or self.edges != "computed"):
            raise TilestampError(
                "coarse tiles with masks: tiles of 4 or 8, one sample a pixel, box tests, edges computed"
            )
        if self.has_masks and (self.grid > GRID_SIDE or self.shading == "visible"):
            raise TilestampError("coarse tiles with masks: grids of 4x4 vertices that are shaded before")
        if self.cull != "none" and not self._is_as_published:
            raise TilestampError("cull: tiles of 4 to 16 as published, with one sample a pixel, edges computed")

    @property
    def _is_as_published(self) -> bool:
        """Whether nothing but the culling differs from the published raster."""
        plain = self.spp == 1 and self.box_tests and self.edges == "computed" and self.tile <= LARGEST_CULLED
        others = self.coarse or self.shading != "vertices" or self.snap_edges or self.hybrid
        return plain and not others and self.grid == GRID_SIDE

    @property
    def has_masks(self) -> bool:
        """Whether the raster is that of coarse tiles, with masks of fine ones."""
        return self.coarse is not None and self.second_level == "masks"

    def launches(self, simt: Simt) -> list[Work]:
        """Tile raster has a thread a pixel of a tile, and its samples in shared memory."""
        loaded, short = self.edges != "computed", self.edges in SHORT
        size = self.coarse if self.coarse and self.has_masks else self.tile
        shape = block_shape(size, self.spp, simt, box_tests=self.box_tests, loaded=loaded, grid=self.grid, short=short)
        return [] if self.hybrid else [raster_work(shape, np.zeros((0, len(TileRasterEvent)), np.int64))]


def micropolygon(
    scene: Scene,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    options: MicropolygonOptions,
    execute: Executor,
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
    grids, shaded = _dice(points, subpatches, view, options, execute)
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
    if options.has_masks:
        buckets = grids.boxes, count, start, lists, tiles, fine
        pixels, drawn, _ = execute(macro_raster, grids.vertices, *buckets, width, height, simt)
    elif options.cull != "none":
        by_depth = options.cull == "sorted"
        lists_of = count, start, lists, tiles
        pixels, drawn, _ = execute(culled_raster, grids.vertices, *lists_of, width, height, simt, by_depth=by_depth)
    else:
        pixels, drawn, _ = execute(
            tile_raster, grids.vertices, count, start, lists, tiles, width, height, simt,
            spp=options.spp, box_tests=options.box_tests, edges=options.edges,
            ids=options.shading == "visible",
        )  # fmt: skip
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


def _dice(
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
