"""Bit mask: samples that a patch has hit are not tested again by its later micropolygons (Yao et al. 2012).

Modelled
--------
- The mask of each patch's box, reads of its words, tests of clear samples, writes at the end of a step.
- What the mask gets wrong where a patch covers a sample twice, and two variants that do not (``facing``, ``depth``).

Not modelled
------------
- Dicing and shading; the exact picture that the result is compared with is no part of the work.
- Machine code: mixes are operations counted by hand.
"""

from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import MicropolygonInput, frame_of, wrong_pixels
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import grouped, micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.yao2011.bit_mask import MaskKind
from tilestamp.simulator.stages.yao2011.bit_mask import bit_mask as filter_samples


class BitMaskOptions(MicropolygonInput, frozen=True, kw_only=True):
    """Options of the pipeline bit-mask."""

    maps: ClassVar[dict[str, str]] = MicropolygonInput.maps | {"wrong": "pixels that the mask makes wrong"}
    persistent: ClassVar[bool] = True
    mask: MaskKind = "plain"
    """The paper's mask, one for each facing, or one that also looks at depth and is exact."""
    lanes: Annotated[int, Meta(ge=1)] | None = None
    """Micropolygons in flight in a warp: 1 is the paper's sequence; none: as many as the machine's warp has lanes."""
    group: Annotated[int, Meta(ge=1)] = 64
    """Consecutive triangles of a mesh that share a mask."""


def bit_mask(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: BitMaskOptions, execute: Executor
) -> Frame:
    """Micropolygons under a bit mask a patch: samples already hit are filtered (Yao et al.)."""
    offsets = sample_positions(options.spp, options.positions)
    samples, exact = new_samples(width, height, offsets), new_samples(width, height, offsets)
    made = micropolygons(scene, matrix, width, height, options.edge, options.triangles)
    masked = made if scene.patches is not None else grouped(made, options.group)
    lanes = simt.warp if options.lanes is None else options.lanes
    execute(filter_samples, masked, samples, options.mask, lanes, simt)
    across_polygons(made, exact, "in-order", simt)  # the picture to compare with: no part of the work
    wrong = wrong_pixels(samples, exact)
    frame = frame_of(samples, made, execute.works, wrong_pixels=int(wrong.sum()))
    frame.maps["wrong"] = wrong.astype(np.int32)
    return frame
