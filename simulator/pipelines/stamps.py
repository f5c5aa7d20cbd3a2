"""Stamps: micropolygons one by one, n x n pixels tested at once (Pineda 1988; Fatahalian et al. 2009).

Modelled
--------
- Stamps of 1 to 64 samples, coarse stamps before them, and both rules of which stamps a polygon touches.
- Every lane that comes along for the ride in a stamp: the definition of sample test efficiency.
- Shading in quads of 2x2 pixels and their merging (``merge_entries``), where asked for (Fatahalian et al. 2010).

Not modelled
------------
- Dicing: micropolygons come as made (``edge``), and their rasterization with depth by atomics is counted. Without
  ``merge_entries`` shading is free, as in the studies of 2009; with it, the shader is one of 64 instructions.
- Machine code: mixes are operations counted by hand, so its times compare algorithms and are no prediction of a GPU.
"""

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import MicropolygonInput, frame_of
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples, picture
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import Touch, stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps import stamps as draw_stamps
from tilestamp.simulator.stages.fatahalian2010.quad_shading import QuadEvent, quad_shading, quad_work
from tilestamp.simulator.work import Work

Pixels = Annotated[int, Meta(ge=1, le=1024)]
Pair = Annotated[tuple[Pixels, ...], Meta(min_length=2, max_length=2)]  # tuple[Pixels, Pixels] crashes msgspec 0.23


class StampsOptions(MicropolygonInput, frozen=True, kw_only=True):
    """Options of the pipeline stamps."""

    persistent: ClassVar[bool] = True
    stamp: Pixels | Pair = 8
    """Pixels on a side of a stamp, or its width and height."""
    touch: Touch = "box"
    """Which stamps are tested: those that touch the polygon's box, or that the polygon reaches."""
    coarse: Annotated[int, Meta(ge=0, le=1024)] = 0
    """Side of the coarse stamp that culls or accepts first, 0 for one level."""
    merge_entries: Annotated[int, Meta(ge=0, le=256)] | None = None
    """Shade in quads of 2x2 pixels, and merge those of neighbours in a buffer of so many entries; 0: without merging;
    none: shading is no part of the frame, and every sample has the colour of its own micropolygon."""
    merge_shared: Literal[0, 1, 2] = 1
    """Vertices that neighbours share, at least: an edge (2), a corner (1), or none (0: all merge that face alike)."""

    def launches(self, simt: Simt) -> list[Work]:
        """Quads that are merged wait in shared memory."""
        if self.merge_entries is None:
            return []
        return [quad_work(np.zeros((0, len(QuadEvent)), np.int64), self.merge_entries, simt)]


def stamps(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: StampsOptions, execute: Executor
) -> Frame:
    """Micropolygons by stamps: n x n pixels tested at once, one level or two (after Fatahalian et al. 2009)."""
    shape = stamp_shape(options.stamp, options.touch, options.coarse)
    samples = new_samples(width, height, sample_positions(options.spp, options.positions))
    polygons = micropolygons(scene, matrix, width, height, options.edge, options.triangles)
    execute(draw_stamps, polygons, samples, shape, simt)
    if options.merge_entries is None:
        return frame_of(samples, polygons, execute.works)
    again = new_samples(width, height, samples.offsets)
    seen = execute(quad_shading, polygons, again, options.merge_entries, simt, options.merge_shared).outputs.seen
    frame = frame_of(samples, polygons, execute.works)
    return replace(frame, image=picture(samples._replace(polygon=seen), polygons))
