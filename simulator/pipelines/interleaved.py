"""Interleaved: moving micropolygons placed at a tile's times and lens points, one by one (Fatahalian et al. 2009).

Modelled
--------
- Each polygon placed at every time and lens point of the pattern's tile, and the pixels that share each.
- Motion on straight lines, circles of confusion of a thin lens.
- Shading apart from visibility, with a cache of shading cells (``shade_cache``; Ragan-Kelley et al. 2011).

Not modelled
------------
- Dicing: micropolygons come as made (``edge``). Without ``shade_cache`` shading is free; with it every micropolygon has
  one colour, so that no picture depends on it.
- Triangles have the price of quads. On an H200 the model is 1.7 to 3.2 times too fast (experiment ``ste/blur``).
"""

from typing import Annotated, ClassVar

from msgspec import Meta

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygons import frame_of
from tilestamp.simulator.pipelines._motion import MotionInput, moving_micropolygons, shade
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, empty_work, interleaved_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interleaved import motion_interleaved
from tilestamp.simulator.work import Work


class InterleavedOptions(MotionInput, frozen=True, kw_only=True):
    """Options of the pipeline interleaved."""

    persistent: ClassVar[bool] = True
    tile: Annotated[int, Meta(ge=1, le=8)] = 2
    """Pixels on a side of the tile whose samples all differ in time and lens point: 2 gives the paper's 16 at 4 spp."""

    def launches(self, simt: Simt) -> list[Work]:
        """One kernel."""
        return [empty_work("interleaved", simt)]


def interleaved(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: InterleavedOptions, execute: Executor
) -> Frame:
    """Motion blur and defocus by interleaved sampling: a set-up for each time and lens point (Fatahalian 2009)."""
    pattern = interleaved_pattern(options.spp, options.tile)
    samples = blur_samples(width, height, pattern)
    still, moving = moving_micropolygons(scene, matrix, width, height, options)
    execute(motion_interleaved, moving, pattern, samples, simt)
    shade(execute, moving, pattern, options, samples, simt)
    return frame_of(samples, still, execute.works)
