"""Execute a pipeline, price what it did: scene x pipeline x machine -> run."""

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.price import Fidelity
from tilestamp.simulator.launchable import check_launches
from tilestamp.simulator.manifest import origin_of
from tilestamp.simulator.options import Options, plain
from tilestamp.simulator.pipelines import can_take, load_pipeline, pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.sampler import Sampler
from tilestamp.simulator.scenes import Scene, load_scene, read_camera
from tilestamp.simulator.scenes.camera import clip_matrix

BYTES_PER_PIXEL = 64  # working memory of the hungriest pipeline: frame buffers, maps, tile lists


def simulate(
    scene: Scene | str | Path,
    pipeline: str = "micropolygon",
    machine: Machine | str | Path = "gtx280",
    *,
    width: int = 1024,
    height: int = 768,
    camera: Any = None,
    fidelity: Fidelity = "schedule",
    error: float = 0.0,
    seed: int = 0,
    picture: bool = True,
    **options: Any,
) -> Run:
    """Draw ``scene`` by ``pipeline`` and price the work on ``machine``.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene, a name of the library, or a file.
    pipeline : str
        See ``tilestamp list pipelines``.
    machine : Machine, str or Path
        A machine, a name, or a machine file.
    width, height : int
        Pixels.
    camera : optional
        A view's name, a ``LookAt``, a 4x4 model-to-clip matrix (row-major, column vectors), or a JSON file; the
        scene's default view if not given.
    fidelity : {"counts", "bounds", "auto", "schedule"}
        How far to go: no time; a roofline for each launch; launch by launch the cheaper of its neighbours that is
        within ``error`` of the latter (5 % if 0); units of work scheduled on the machine.
    error : float
        Relative error that will do, 0 to 1. Above 0 the expensive stages execute a random part of their units, no
        picture is drawn, and each number carries its 95 % interval (``Run.intervals``); the part grows until the
        half-width of each stage's instructions and sample tests and hits, and of the frame's time, is under ``error``
        of their value. Frames too small to pay for a sample run in full, and so do stages whose tail decides.
    seed : int
        Of the random part.
    picture : bool
        Whether one is wanted; without it what only makes the picture is skipped.
    **options
        The pipeline's own: ``tilestamp list options PIPELINE``.

    Returns
    -------
    Run

    Raises
    ------
    TilestampError
        Bad input, in one sentence.
    """
    drawing = Drawing(width=width, height=height, fidelity=fidelity, error=error, seed=seed, picture=picture)
    width, height, error = drawing.width, drawing.height, drawing.error
    chosen = pipeline_options(pipeline, options)
    scene, machine = load_scene(scene), load_machine(machine)
    if drawing.fidelity != "counts" and getattr(chosen, "counting", True):
        check_launches(pipeline, chosen, machine)
    matrix = clip_matrix(read_camera(camera, scene), width, height)
    origin = origin_of(scene, matrix, drawing.seed)
    run = partial(Run, scene.name, pipeline, machine, width, height, drawing.fidelity, plain(chosen), origin=origin)
    draw = partial(load_pipeline(pipeline), scene, matrix, width, height, machine.simt, chosen)
    note = scene.note
    without_picture = {"picture": False} if can_take(pipeline, "picture") else {}
    if error and can_take(pipeline, "sample"):
        sampler = Sampler(error, drawing.seed, pipeline, machine)
        frame = draw(sample=sampler, **without_picture)
        if sampler.executed:
            facts = {"units": sampler.executed, "seconds_saved": sampler.seconds_saved}
            return _escalated(run(frame, note, error, facts), sampler)
        return run(frame, _joined(note, "everything ran: a sample would cost more"), error)
    if error:
        note = _joined(note, f"everything ran: {pipeline} cannot be sampled")
    return run(draw(**{} if drawing.picture else without_picture), note, error)


def _joined(*notes: str) -> str:
    return "; ".join(filter(None, notes))


def _escalated(run: Run, sampler: Sampler) -> Run:
    """Run all units of the launches, the least sure first, whose samples do not tell the frame's time within the error.

    A stage whose tail decides is one: which unit meets which, only all units say.
    """
    if run.fidelity == "counts" or run.milliseconds_interval.relative <= run.error:
        return run
    half = np.array([found["milliseconds"].half_width for found in run.launch_intervals])
    order = np.argsort(-half)
    left = np.cumsum(half[order][::-1] ** 2)[::-1]  # of the variance, before each is escalated
    chosen = order[(left > (run.error * run.milliseconds) ** 2) & (half[order] > 0)]
    works = list(run.frame.works)
    for index in chosen:
        works[index] = sampler.finished(works[index])
    kernels = dict.fromkeys(works[index].kernel for index in sorted(chosen))
    note = _joined(
        run.note, f"all units ran of {', '.join(kernels)}: its tail decides, or part of it did not tell enough"
    )
    facts = run.sampled | {"seconds_saved": sampler.seconds_saved}
    return replace(run, frame=replace(run.frame, works=works), note=note, sampled=facts)


class Drawing(Options, frozen=True, kw_only=True):
    """What every pipeline is asked alike."""

    width: Annotated[int, Meta(ge=1)]
    """Pixels."""
    height: Annotated[int, Meta(ge=1)]
    """Pixels."""
    fidelity: Fidelity
    """How far to go."""
    error: Annotated[float, Meta(ge=0, lt=1)]
    """Share of the value that will do."""
    seed: Annotated[int, Meta(ge=0)]
    """Of the random part."""
    picture: bool
    """Whether one is wanted."""

    def __post_init__(self) -> None:
        super().__post_init__()
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        if self.width * self.height * BYTES_PER_PIXEL > memory:
            raise TilestampError(
                f"an image of {self.width}x{self.height} pixels does not fit in this computer's memory"
            )
