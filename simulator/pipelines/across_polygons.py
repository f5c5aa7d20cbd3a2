"""Across polygons: one lane a micropolygon, each walking its own box (Fatahalian et al. 2009, without blur).

Modelled
--------
- A lane a micropolygon that walks its box, in input order, sorted within the warp, or repacked as lanes fall idle.
- The sort and the repacking, as instructions of the warp.

Not modelled
------------
- Dicing and shading: micropolygons come as made (``edge``), and their rasterization with depth by atomics is counted.
- Machine code: mixes are operations counted by hand, so its times compare algorithms and are no prediction of a GPU.
"""

from typing import ClassVar

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import MicropolygonInput, frame_of
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.across_polygons import Packing
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons as walk_boxes
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions


class AcrossPolygonsOptions(MicropolygonInput, frozen=True, kw_only=True):
    """Options of the pipeline across-polygons."""

    persistent: ClassVar[bool] = True
    packing: Packing = "in-order"
    """How polygons come to lanes."""


def across_polygons(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: AcrossPolygonsOptions, execute: Executor
) -> Frame:
    """Micropolygons in parallel: a lane each, warps as long as their longest (Fatahalian et al. 2009)."""
    samples = new_samples(width, height, sample_positions(options.spp, options.positions))
    polygons = micropolygons(scene, matrix, width, height, options.edge, options.triangles)
    execute(walk_boxes, polygons, samples, options.packing, simt)
    return frame_of(samples, polygons, execute.works)
