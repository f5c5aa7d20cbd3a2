"""What a call would take on a GPU: the four kernels and the pixel shader, as they were counted, priced."""

from collections.abc import Sequence

from tilestamp.models.machine import Machine
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import plain
from tilestamp.simulator.pipelines import pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.stages.laine2011.parameter_copy import COPYING, with_parameter_copy
from tilestamp.simulator.work import Work


def priced(works: Sequence[Work], machine: Machine, width: int, height: int) -> Run:
    """Price the launches of a call; setup and bin raster copy their parameters, as the published build does."""
    options = plain(pipeline_options("cudaraster", {"release": "nvdiffrast", "copy_parameters": True}))
    copied = [with_parameter_copy(work) if work.kernel in COPYING else work for work in works]
    frame = Frame.numbers(copied, {})
    return Run("a call of nvdiffrast.rasterize", "cudaraster", machine, width, height, "schedule", options, frame)
