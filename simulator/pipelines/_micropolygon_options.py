"""Options of the pipeline micropolygon, and what does not go together."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.options import Options
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import (
    MAX_DEPTH,
    BoundRule,
)
from tilestamp.simulator.stages.eisenacher2010.culled_raster import Cull
from tilestamp.simulator.stages.eisenacher2010.dice import GRID_SIDE
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide
from tilestamp.simulator.stages.eisenacher2010.tile_range import TileSize
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Edges, raster_work
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import SHORT, TileRasterEvent, block_shape
from tilestamp.simulator.work import Work

LARGEST_CULLED = 16  # pixels a side of a tile whose grids are culled
FINE = 8  # pixels a side of a fine tile at most, where warps have one each


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
