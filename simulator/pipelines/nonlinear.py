"""Nonlinear: fisheye, paraboloid and cylindrical pictures, by a line of sight a sample or by tessellation.

Modelled
--------
- Lines of sight of each sample against the planes through the eye and a triangle's edges: exact but for rounding, all
  around the eye; cones of bins and tiles that bound them; lists by tile.
- Tessellation by edges until straight lines are within ``tolerance`` pixels, then the same lists and raster on screen.

Not modelled
------------
- Vertex shading and shading: triangles come in eye space, a grey each.
- Machine code of lists and tessellation: they are counted by hand. Compute capability 9.0 alone.
"""

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.pipelines._micropolygons import MicropolygonInput, frame_of
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import BlurPattern
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS, sample_positions
from tilestamp.simulator.stages.nonlinear.bounds import BIN, edge_planes, outlines, visit_bins, visit_cones
from tilestamp.simulator.stages.nonlinear.projections import Kind, Projection, project, projection, rays
from tilestamp.simulator.stages.nonlinear.tessellate import tessellate
from tilestamp.simulator.stages.stochastic.bounds import EVERYTHING, visit_tiles
from tilestamp.simulator.stages.stochastic.sample_raster import (
    SampleRasterEvent,
    raster_launch,
    ray_raster,
    sample_raster,
)
from tilestamp.simulator.stages.stochastic.tile_lists import moving_lists
from tilestamp.simulator.stages.stochastic.triangles import Lens, moving_triangles, scene_triangles
from tilestamp.simulator.work import Work

REMARKS = {
    "torn": "{:,} small triangles on the seam of the picture, or a pole, are not drawn: lines cannot go around it"
}
CORNER_BYTES = 48  # three corners in eye space, padded


class NonlinearOptions(MicropolygonInput, frozen=True, kw_only=True):
    """Options of the pipeline nonlinear."""

    projection: Kind = "fisheye"
    """How lines of sight lie on screen."""
    fov: Annotated[float, Meta(gt=0, le=360)] = 180.0
    """Angle across the width of the picture, degrees."""
    method: Literal["rays", "tessellated"] = "rays"
    """A line of sight a sample, or straight edges after tessellation."""
    tolerance: Annotated[float, Meta(gt=0)] = 0.5
    """Pixels that the middle of an edge may lie off its chord, of tessellation."""
    tile: Annotated[int, Meta(ge=4, le=16)] = 8
    """Pixels on a side of a tile; a block has a thread for each."""
    double: bool = True
    """Test samples in float64: no sample is wrong but for its rounding; float32 is what a GPU would take."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """The raster has a thread a pixel of a tile, and the tile's samples in shared memory."""
        return [raster_launch(np.zeros((0, len(SampleRasterEvent)), np.int64), self.tile, self.spp, "rays")]


def nonlinear(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: NonlinearOptions, execute: Executor
) -> Frame:
    """Fisheye, paraboloid and cylindrical pictures in tiles: a line of sight a sample, or tessellation."""
    samples = new_samples(width, height, sample_positions(options.spp, options.positions))
    clip, made = scene_triangles(scene, matrix, width, height, options.edge)
    corners = eye_space(clip, matrix)
    to = projection(options.projection, options.fov, width, height)
    if options.method == "rays":
        _sight(corners, to, samples, simt, options, execute)
        return frame_of(samples, made, execute.works)
    whose, torn = _straight(corners, to, samples, simt, options, execute)
    small = Micropolygons(np.empty((len(whose), 3, 3), np.float32), made.patch[whose], made.shade[whose])
    frame = frame_of(samples, small, execute.works, torn=torn)
    return replace(frame, warnings=remarks(REMARKS, frame.facts))


def eye_space(clip: NDArray[np.float64], matrix: NDArray[Any]) -> NDArray[np.float32]:
    """Corners in eye space (M, 3, 3), z ahead, from clip space and a perspective camera's matrix.

    Raises
    ------
    TilestampError
        The camera is a parallel projection, or the scene is in clip space.
    """
    scales = np.linalg.norm(np.asarray(matrix, float)[[0, 1, 3], :3], axis=1)
    if not scales[2] or np.array_equal(matrix, np.eye(4)):
        raise TilestampError("the pipeline nonlinear needs a perspective camera: lines of sight that meet in the eye")
    return np.asarray(clip[..., [0, 1, 3]] / scales, np.float32)


def sample_rays(to: Projection, samples: Samples) -> NDArray[np.float64]:
    """Line of sight of each sample, (H, W, spp, 3)."""
    offsets = samples.offsets / SUBPIXELS
    x = np.arange(to.width)[None, :, None] + offsets[:, 0]
    y = np.arange(to.height)[:, None, None] + offsets[:, 1]
    return rays(to, x, y)


def _sight(
    corners: NDArray[np.float32], to: Projection, samples: Samples, simt: Simt, options: NonlinearOptions,
    execute: Executor,
) -> None:  # fmt: skip
    planes = edge_planes(corners, double=options.double)
    found = outlines(planes)
    bins, _, _ = execute(
        moving_lists, visit_bins(found, to, options.tile), _tiles(to, options.tile * BIN), simt, CORNER_BYTES
    )
    visits, owners = visit_cones(found, bins, to, options.spp, options.tile)
    lists, _, _ = execute(moving_lists, visits, _tiles(to, options.tile), simt, CORNER_BYTES, owners)
    light = sample_rays(to, samples)
    execute(ray_raster, planes.normals, planes.volumes, lists, light, samples, simt, tile=options.tile)


def _straight(
    corners: NDArray[np.float32], to: Projection, samples: Samples, simt: Simt, options: NonlinearOptions,
    execute: Executor,
) -> tuple[NDArray[np.int64], int]:  # fmt: skip
    """Draw by tessellation; returns the triangle that each small one is part of, and how many were torn."""
    (small, parents), _, facts = execute(tessellate, corners.astype(np.float64), to, options.tolerance, simt)
    distance = np.linalg.norm(small, axis=2)
    flat = np.ones((*small.shape[:2], 4), np.float32)
    flat[..., :2], flat[..., 2] = project(to, small), 2 * distance / (1 + distance) - 1
    triangles = moving_triangles(flat, flat, Lens(0.0, 1.0), double=options.double)
    pattern = BlurPattern(samples.offsets[None, None], np.zeros((1, 1, options.spp, 3)))
    visits = visit_tiles(triangles, np.array([EVERYTHING]), options.spp, to.width, to.height, options.tile)
    lists, _, _ = execute(moving_lists, visits, _tiles(to, options.tile), simt, CORNER_BYTES)
    execute(sample_raster, triangles, lists, pattern, samples, simt, tile=options.tile)
    return parents, int(facts["torn"])


def _tiles(to: Projection, tile: int) -> int:
    return -(-to.width // tile) * -(-to.height // tile)
