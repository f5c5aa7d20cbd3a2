"""Execute a pipeline, price what it did: scene x pipeline x machine -> run."""

import os
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from tilestamp.models.compile_ahead import compile_ahead
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.price import Fidelity
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.launchable import check_launches, check_scene
from tilestamp.simulator.manifest import origin_of
from tilestamp.simulator.options import Options, plain
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.rehearsal import rehearse, small
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene, load_scene, read_camera
from tilestamp.simulator.scenes.camera import clip_matrix
from tilestamp.simulator.scenes.camera_files import CameraSource
from tilestamp.simulator.scenes.pinhole import pinhole_camera

SIZE = 1024, 768  # pixels, where neither is given nor known
BYTES_PER_PIXEL = 64  # working memory of the hungriest pipeline: frame buffers, maps, tile lists


def simulate(
    scene: Scene | str | Path,
    pipeline: str = "micropolygon",
    machine: Machine | str | Path = "gtx280",
    *,
    width: int | None = None,
    height: int | None = None,
    camera: CameraSource = None,
    fidelity: Fidelity = "schedule",
    counting: bool = True,
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
    width, height : int, optional
        Pixels; without either, those of a camera that has some, else 1024 and 768.
    camera : optional
        A view's name, a ``LookAt``, a 4x4 model-to-clip matrix (row-major, column vectors), or a JSON file; the
        scene's default view if not given.
    fidelity : {"counts", "bounds", "schedule"}
        How far to go: no time; a roofline for each launch; units of work scheduled on the machine.
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
    drawing = Drawing(
        width=SIZE[0] if width is None else width,
        height=SIZE[1] if height is None else height,
        fidelity=fidelity,
        counting=counting,
        picture=picture,
    )
    counting = drawing.counting
    chosen = pipeline_options(pipeline, options)
    machine = load_machine(machine)
    if chosen.votes or (drawing.fidelity != "counts" and counting):
        check_launches(pipeline, chosen, machine)
    scene = load_scene(scene)
    check_scene(pipeline, chosen, scene)
    seen_by = read_camera(camera, scene)
    own = getattr(seen_by, "screen", None)
    if own and width is None and height is None:
        drawing = msgspec.structs.replace(drawing, width=own[0], height=own[1])
    width, height = drawing.width, drawing.height
    matrix = clip_matrix(seen_by, width, height)
    asked_of_all = {"fidelity": fidelity, "counting": counting, "picture": picture}
    compile_ahead(rehearse, simulate, small(scene), pipeline, machine, asked_of_all, options)
    view = pinhole_camera(seen_by, width, height) if chosen.splats else matrix
    execute = Executor(counting=counting, picture=drawing.picture)
    frame = load_pipeline(pipeline)(scene, view, width, height, machine.simt, chosen, execute)
    origin, asked = origin_of(scene, matrix), plain(chosen)
    return Run(
        scene.name, pipeline, machine, width, height, drawing.fidelity, asked, frame, scene.note,
        counted=counting, origin=origin,
    )  # fmt: skip


class Drawing(Options, frozen=True, kw_only=True):
    """What every pipeline is asked alike."""

    width: Annotated[int, Meta(ge=1)]
    """Pixels."""
    height: Annotated[int, Meta(ge=1)]
    """Pixels."""
    fidelity: Fidelity
    """How far to go."""
    counting: bool
    """Whether to count."""
    picture: bool
    """Whether one is wanted."""

    def __post_init__(self) -> None:
        super().__post_init__()
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        if self.width * self.height * BYTES_PER_PIXEL > memory:
            raise TilestampError(
                f"an image of {self.width}x{self.height} pixels does not fit in this computer's memory"
            )
