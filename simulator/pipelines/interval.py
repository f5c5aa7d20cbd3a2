"""Interval: stochastic samples of moving micropolygons, found by boxes over intervals (Fatahalian et al. 2009).

Modelled
--------
- Samples in x, y, time and lens; a box for each interval of time and lens; a warp as long as its longest lane.
- Motion on straight lines, circles of confusion of a thin lens.
- Shading apart from visibility, with a cache of shading cells (``shade_cache``; Ragan-Kelley et al. 2011).

Not modelled
------------
- Dicing: micropolygons come as made (``edge``). Without ``shade_cache`` shading is free; with it every micropolygon has
  one colour, so that no picture depends on it.
- Triangles have the price of quads. On an H200 the model is 1.7 to 3.2 times too fast (experiment ``ste/blur``).
"""

from typing import Annotated, Any, ClassVar

from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import frame_of
from tilestamp.simulator.pipelines._motion import MotionInput, moving_micropolygons, shade
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, empty_work, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interval import motion_interval
from tilestamp.simulator.work import Work


class IntervalOptions(MotionInput, frozen=True, kw_only=True):
    """Options of the pipeline interval."""

    persistent: ClassVar[bool] = True
    intervals: Annotated[int, Meta(ge=1, le=16)] | None = None
    """Intervals of time and lens that share out a pixel's samples; none: as many as samples."""

    def launches(self, simt: Simt) -> list[Work]:
        """One kernel."""
        return [empty_work("interval", simt)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.intervals is not None and self.intervals > self.spp:
            raise TilestampError(f"intervals is at most spp: {self.intervals} of {self.spp} samples a pixel")


def interval(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: IntervalOptions, execute: Executor
) -> Frame:
    """Motion blur and defocus by boxes over intervals of time and lens (Pixar's way; Fatahalian et al. 2009)."""
    pattern = stratified_pattern(options.spp)
    samples = blur_samples(width, height, pattern)
    still, moving = moving_micropolygons(scene, matrix, width, height, options)
    execute(motion_interval, moving, pattern, samples, simt, options.intervals)
    shade(execute, moving, pattern, options, samples, simt)
    return frame_of(samples, still, execute.works)
