"""The synthetic sweep of Figure 5, executed once an area; which areas are drawn, and which of them were fitted on."""

import os
from functools import cache

import numpy as np

from tilestamp.experiments.harness.published import published
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import on_frame
from tilestamp.models.machine import load_machine
from tilestamp.models.remembered import remembered
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.manifest import origin_of
from tilestamp.simulator.options import plain
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene

SOURCE = "Laine & Karras, High-Performance Software Rasterization on GPUs, HPG 2011, and the benchmark of release 1.1"
MACHINE = "gtx480"
WIDTH, HEIGHT = 1024, 768
STAGES = {"triangle_setup": "setup", "bin_raster": "bin", "coarse_raster": "coarse", "fine_raster": "fine"}
PUBLISHED_AREAS = tuple(tick / 4 for tick in range(161))
DEFAULT_AREAS = (0.0, 0.5, 1.0, 4.0, 8.0, 16.0, 40.0)
VARIABLE = "TILESTAMP_SWEEP"  # "all" for the 161 published areas, or areas: "0.5,3,17"


def areas() -> tuple[float, ...]:
    """Areas to draw, in pixels a triangle: seven, unless the environment variable TILESTAMP_SWEEP names others.

    Raises
    ------
    TilestampError
        An area that the authors did not measure.
    """
    asked = os.environ.get(VARIABLE, "")
    if not asked:
        return DEFAULT_AREAS
    if asked == "all":
        return PUBLISHED_AREAS
    try:
        chosen = tuple(sorted({float(area) for area in asked.split(",")}))
    except ValueError:
        chosen = ()
    if not chosen or not set(chosen) <= set(PUBLISHED_AREAS):
        raise TilestampError(
            f"{VARIABLE} is {asked!r}; it takes 'all' or areas in steps of 0.25 up to 40, as '0.5,3,17'"
        )
    return chosen


@remembered
def draw(area: float, name: str = MACHINE) -> tuple[Run, int]:
    """Draw one area on a machine; give the run without its picture, and its triangles."""
    machine = load_machine(name)
    scene = Scene.sweep(area, WIDTH, HEIGHT)
    options = CudarasterOptions(mode="color")
    frame = cudaraster(scene, np.eye(4), WIDTH, HEIGHT, machine.simt, options, Executor())
    assert scene.mesh is not None  # noqa: S101 - a sweep is a mesh
    nothing = np.empty((0, 0, 3), np.uint8)
    bare = Frame(nothing, nothing, frame.works, facts=frame.facts)
    origin = origin_of(scene, np.eye(4))
    run = Run(scene.name, "cudaraster", machine, WIDTH, HEIGHT, "schedule", plain(options), bare, origin=origin)
    return run, len(scene.mesh.triangles)


def nanoseconds(run: Run, triangles: int) -> dict[str, float]:
    """Time of each stage for one triangle."""
    return {stage: float(run.stages.loc[stage, "milliseconds"]) * 1e6 / triangles for stage in STAGES}


def frame_name(area: float) -> str:
    """The frame of an area, as fitted numbers name it."""
    return f"sweep {area:g} px {WIDTH}x{HEIGHT}"


@cache
def fitted_areas() -> tuple[float, ...]:
    """Areas that numbers of the mix were fitted on."""
    from tilestamp.simulator.mix import load_mix

    numbers = [number for kernel in load_mix("cudaraster", "2.0").kernels.values() for number in kernel.fitted.values()]
    return tuple(
        area
        for area in PUBLISHED_AREAS
        if any(on_frame(target, frame_name(area)) for number in numbers for target in number.fitted_to)
    )


def fitted_entries() -> int:
    """Numbers of the mix that were chosen on the sweep."""
    from tilestamp.simulator.mix import load_mix

    return sum(
        kind == "fitted"
        for name, kernel in load_mix("cudaraster", "2.0").kernels.items()
        if ":" not in name or name.endswith("color")
        for kind, _ in kernel.provenance.values()
    )


@cache
def published_ns() -> dict[tuple[float, str], float]:
    """Published nanoseconds a triangle by (area, stage)."""
    log = published(__file__, "gtx480-cuda40")
    rows = log[(log["table"] == "figure5") & (log["renderer"] == "CudaRaster")]
    names = {f"{short}_ms": stage for stage, short in STAGES.items()}
    return {
        (float(row.key.removeprefix("area=")), names[row.column]): float(row.value)
        for row in rows.itertuples()
        if row.column in names
    }
