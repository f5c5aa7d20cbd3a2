"""Execute a pipeline, price what it did: scene x pipeline x machine -> run."""

import os
from typing import Any

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.price import FIDELITIES, Fidelity
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.options import plain
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.sampling.completed import completed
from tilestamp.simulator.sampling.executor import SampledExecutor
from tilestamp.simulator.scenes import Scene, load_scene, read_camera

BYTES_PER_PIXEL = 64  # working memory of the hungriest pipeline: frame buffers, maps, tile lists


def simulate(
    scene: Scene | str,
    pipeline: str = "micropolygon",
    machine: Machine | str = "gtx280",
    *,
    width: int = 1024,
    height: int = 768,
    camera: Any = None,
    fidelity: Fidelity = "schedule",
    error: float = 0.0,
    seed: int = 0,
    counting: bool = True,
    picture: bool = True,
    **options: Any,
) -> Run:
    """Draw ``scene`` by ``pipeline`` and price the work on ``machine``.

    Parameters
    ----------
    scene : Scene or str
        A scene, a name of the library, or a file.
    pipeline : str
        See ``tilestamp list pipelines``.
    machine : Machine or str
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
    counting : bool
        Count what the machine does; without it there is a picture, and nothing to price.
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
    scene = load_scene(scene) if isinstance(scene, str) else scene
    machine = load_machine(machine) if isinstance(machine, str) else machine
    _check(fidelity, width, height)
    chosen = pipeline_options(pipeline, options)
    if not 0.0 <= error < 1.0:
        raise TilestampError(f"error is a share of the value, 0 to 1, not {error}")
    view = read_camera(camera if camera is not None else "default", scene)
    matrix = view.matrix(width, height)
    sampled = error and counting
    execute = (
        SampledExecutor(error, seed, pipeline, machine) if sampled else Executor(counting=counting, picture=picture)
    )
    frame = load_pipeline(pipeline)(scene, matrix, width, height, machine.simt, chosen, execute)
    run = Run(
        scene.name,
        pipeline,
        machine,
        width,
        height,
        fidelity,
        plain(chosen),
        frame,
        scene.note,
        error,
        counted=counting,
    )
    return completed(run, execute) if isinstance(execute, SampledExecutor) else run


def _check(fidelity: str, width: int, height: int) -> None:
    """Refuse what no pipeline can draw."""
    if fidelity not in FIDELITIES:
        raise TilestampError(f"fidelity is {', '.join(FIDELITIES)}, not {fidelity}")
    if width < 1 or height < 1:
        raise TilestampError(f"an image of {width}x{height} pixels has no pixels")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if width * height * BYTES_PER_PIXEL > memory:
        raise TilestampError(f"an image of {width}x{height} pixels does not fit in this computer's memory")
