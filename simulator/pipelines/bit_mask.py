"""Bit mask: samples that a patch has hit are not tested again by its later micropolygons (Yao et al. 2012)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygon_options import frame_of, wrong_pixels
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import grouped, micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.yao2011.bit_mask import MaskKind
from tilestamp.simulator.stages.yao2011.bit_mask import bit_mask as filter_samples


def bit_mask(
    scene: Scene,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    execute: Executor,
    *,
    mask: MaskKind = "plain",
    lanes: int | None = None,
    group: int = 64,
    spp: int = 1,
    positions: str | None = None,
    edge: float = 1.0,
    triangles: bool = False,
) -> Frame:
    """Micropolygons under a bit mask a patch: samples already hit are filtered (Yao et al.).

    Parameters
    ----------
    scene, matrix, width, height, simt, execute
        As for every pipeline.
    mask : {"plain", "facing", "depth"}
        The paper's mask, one for each facing, or one that also looks at depth and is exact.
    lanes : int, optional
        Micropolygons in flight in a warp; 1 is the paper's sequence, the machine's warp if not given.
    group : int
        Consecutive triangles of a mesh that share a mask.
    spp, positions, edge, triangles
        As for ``stamps``.
    """
    offsets = sample_positions(spp, positions)
    samples, exact = new_samples(width, height, offsets), new_samples(width, height, offsets)
    made = micropolygons(scene, matrix, width, height, edge, triangles)
    masked = made if scene.patches is not None else grouped(made, group)
    execute(filter_samples, masked, samples, mask, simt.warp if lanes is None else lanes, simt)
    across_polygons(made, exact, "in-order", simt)  # the picture to compare with: no part of the work
    wrong = wrong_pixels(samples, exact)
    frame = frame_of(samples, made, execute.works, wrong_pixels=int(wrong.sum()))
    frame.maps["wrong"] = wrong.astype(np.int32)
    return frame
