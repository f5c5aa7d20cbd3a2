"""Stochastic: moving, defocused triangles in lists by tile, a test for each sample in x, y, time and lens.

Modelled
--------
- Bounds of moving and defocused triangles in tiles, over all of shutter and lens or by interval; lists by tile with a
  mask of samples; a test of 27 multiply-adds for each sample, exact but for the rounding of float64 (``double``).
- Corners on straight lines in clip space (``motion``, ``dolly``), through the eye's plane too: nothing is clipped.

Not modelled
------------
- Dicing, vertex shading and shading: triangles come projected, a grey each.
- Bounds of edges: a triangle larger than a tile is listed wherever its box is not cut by a plane.
- Contraction to fused multiply-adds, which would make an edge differ between its two triangles on a GPU.
- Machine code of the lists: they are counted by hand; the raster's is that of our kernel. Compute capability 9.0 alone.
"""

from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import frame_of
from tilestamp.simulator.pipelines._motion import MotionInput
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interval import intervals_of
from tilestamp.simulator.stages.stochastic.bounds import visit_tiles
from tilestamp.simulator.stages.stochastic.sample_raster import SampleRasterEvent, raster_launch, sample_raster
from tilestamp.simulator.stages.stochastic.tile_lists import moving_lists
from tilestamp.simulator.stages.stochastic.triangles import (
    Lens,
    MovingTriangles,
    homogeneous_pixels,
    moving_triangles,
    scene_triangles,
)
from tilestamp.simulator.work import Work


class StochasticOptions(MotionInput, frozen=True, kw_only=True):
    """Options of the pipeline stochastic."""

    tile: Annotated[int, Meta(ge=4, le=16)] = 8
    """Pixels on a side of a tile; a block has a thread for each."""
    bounds: Literal["whole", "intervals"] = "intervals"
    """Bound a triangle in a tile over all of shutter and lens, or over the interval of each sample of a pixel too."""
    dolly: float = 0.0
    """How far the scene comes towards the eye while the shutter is open, in model units."""
    sample_seed: Annotated[int, Meta(ge=0)] = 7
    """Of the places, times and lens points of the samples."""
    double: bool = False
    """Test samples in float64: no sample is wrong but for its rounding; float32 is what a GPU would take."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """The raster has a thread a pixel of a tile, and the tile's samples in shared memory."""
        none = np.zeros((0, len(SampleRasterEvent)), np.int64)
        return [raster_launch(none, self.tile, self.spp, "double" if self.double else "")]


def stochastic(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: StochasticOptions, execute: Executor
) -> Frame:
    """Motion blur and defocus in tiles: bounds over time and lens, a 5D edge test a sample (after Laine 2011)."""
    pattern, tile = stratified_pattern(options.spp, seed=options.sample_seed), options.tile
    samples = blur_samples(width, height, pattern)
    triangles, still = _triangles(scene, matrix, width, height, options)
    intervals = intervals_of(pattern, 1 if options.bounds == "whole" else None)
    visits = visit_tiles(triangles, intervals, options.spp, width, height, tile)
    lists, _, _ = execute(moving_lists, visits, -(-width // tile) * -(-height // tile), simt)
    execute(sample_raster, triangles, lists, pattern, samples, simt, tile=tile)
    pairs = {"listed pairs": len(lists.entries), "longest list": int(np.diff(lists.starts).max())}
    return frame_of(samples, still, execute.works, **pairs)


def _triangles(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, options: StochasticOptions
) -> tuple[MovingTriangles, Micropolygons]:
    """Place the scene at both ends of the shutter interval."""
    clip, still = scene_triangles(scene, matrix, width, height, options.edge)
    start = homogeneous_pixels(clip, width, height)
    angle = np.radians(options.direction)
    end = homogeneous_pixels(clip + _dolly(scene, matrix, options.dolly), width, height)
    end[..., :2] += np.float32(options.motion) * np.array([np.cos(angle), -np.sin(angle)], np.float32) * end[..., 3:]
    lens = Lens(options.lens, options.focus or float(clip[..., 3].mean()))
    return moving_triangles(start, end, lens, double=options.double), still


def _dolly(scene: Scene, matrix: NDArray[Any], way: float) -> NDArray[np.float64]:
    """What is added to clip positions when the scene comes nearer."""
    ahead = np.zeros(3) if scene.mesh is not None and scene.mesh.clip_space else np.asarray(matrix, float)[3, :3]
    if way and not ahead.any():
        raise TilestampError("dolly needs a perspective camera: in this view nothing comes nearer")
    step = -way * ahead / np.linalg.norm(ahead) if way else ahead
    return np.asarray(matrix, float)[:, :3] @ step if way else np.zeros(4)
