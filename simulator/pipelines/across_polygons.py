"""Across polygons: one lane a micropolygon, each walking its own box (Fatahalian et al. 2009, without blur)."""

from typing import Any

from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygon_options import frame_of
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.across_polygons import Packing
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons as walk_boxes
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions


def across_polygons(
    scene: Scene,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    execute: Executor,
    *,
    packing: Packing = "in-order",
    spp: int = 1,
    positions: str | None = None,
    edge: float = 1.0,
    triangles: bool = False,
) -> Frame:
    """Micropolygons in parallel: a lane each, warps as long as their longest (Fatahalian et al. 2009).

    Parameters
    ----------
    scene, matrix, width, height, simt, execute
        As for every pipeline.
    packing : {"in-order", "sorted", "repacked"}
        How polygons come to lanes.
    spp, positions, edge, triangles
        As for ``stamps``.
    """
    samples = new_samples(width, height, sample_positions(spp, positions))
    polygons = micropolygons(scene, matrix, width, height, edge, triangles)
    execute(walk_boxes, polygons, samples, packing, simt)
    return frame_of(samples, polygons, execute.works)
