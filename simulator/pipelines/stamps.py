"""Stamps: micropolygons one by one, n x n pixels tested at once (Pineda 1988; Fatahalian et al. 2009)."""

from typing import Any

from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._micropolygon_options import frame_of
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import Touch, stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps import stamps as draw_stamps


def stamps(
    scene: Scene,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    execute: Executor,
    *,
    stamp: int | tuple[int, int] = 8,
    touch: Touch = "box",
    coarse: int = 0,
    spp: int = 1,
    positions: str | None = None,
    edge: float = 1.0,
    triangles: bool = False,
) -> Frame:
    """Micropolygons by stamps: n x n pixels tested at once, one level or two (after Fatahalian et al. 2009).

    Parameters
    ----------
    scene, matrix, width, height, simt, execute
        As for every pipeline.
    stamp : int or (int, int)
        Width and height of a stamp in pixels.
    touch : {"box", "polygon"}
        Which stamps are tested: those that touch the polygon's box, or that the polygon reaches.
    coarse : int
        Side of the coarse stamp that culls or accepts first, 0 for one level.
    spp : int
        Samples a pixel, 1 to 16.
    positions : str, optional
        File of sample positions.
    edge : float
        Micropolygons of patches have edges of at most so many pixels.
    triangles : bool
        Split micropolygons into triangles.
    """
    shape = stamp_shape(stamp, touch, coarse)
    samples = new_samples(width, height, sample_positions(spp, positions))
    polygons = micropolygons(scene, matrix, width, height, edge, triangles)
    execute(draw_stamps, polygons, samples, shape, simt)
    return frame_of(samples, polygons, execute.works)
