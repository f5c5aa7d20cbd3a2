"""What ``tilestamp render`` draws: the scene, and the pipeline and machine, chosen where none is named."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.commands.option_flags import given_options, literal, once, parted
from tilestamp.models.errors import TilestampError, UnableError
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.launchable import able_machines, check_launches
from tilestamp.simulator.pipelines import options_type, pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene, load_scene, read_camera

PIPELINE = "micropolygon"  # where none is named and the scene has patches
OF_MESHES = ("cudaraster", "freepipe")  # where it has none: the first that the machine can run
OF_SPLATS = "splat"  # where it has those
OF_TEXTURES = ("tiled", "per-primitive")  # the same, where a mesh is to have a texture
USUAL = "gtx280"  # where no machine is named and it can run the pipeline


@dataclass(frozen=True)
class Wanted:
    """What a user asks to be drawn; names that are None are chosen."""

    scene: str
    pipeline: str | None
    machine: str | None
    size: tuple[int, int] | None
    camera: str | None = None
    zoom: float = 1.0
    texture: Path | None = None
    map_: str | None = None
    """Counter whose heat map is wanted."""
    changes: tuple[str, ...] = ()
    """Of the machine, ``SECTION.NAME=VALUE``."""
    flags: dict[str, str | bool | None] = field(default_factory=dict)
    assigned: tuple[str, ...] = ()
    """Options of the pipeline, ``NAME=VALUE``; ``flags`` are others."""

    def options(self, pipeline: str) -> dict[str, Any]:
        """Options that are given, checked."""
        given = given_options(options_type(pipeline), self.flags, self.assigned)
        pipeline_options(pipeline, given)
        return given

    def described(self, machine: str) -> Machine:
        """Load a machine, with its what-ifs."""
        described = load_machine(machine)
        written = {name: literal(value) for name, value in once(map(parted, self.changes)).items()}
        return altered(described, written, "assumed", "a what-if on the command line") if written else described


def draw(wanted: Wanted, **asked: Any) -> tuple[Run, str]:
    """Simulate what is wanted; the sentence says what was chosen other than usually.

    Raises
    ------
    UnableError
        A pipeline that cannot draw the scene, or a machine that cannot run it.
    """
    from tilestamp.simulator.simulation import simulate

    machine = wanted.described(wanted.machine) if wanted.machine else None
    priced = asked["counting"] and asked["fidelity"] != "counts"
    if wanted.pipeline and machine and priced:  # before the scene is read
        check_launches(wanted.pipeline, pipeline_options(wanted.pipeline, wanted.options(wanted.pipeline)), machine)
    image = _image(wanted.texture) if wanted.texture else None
    scene = load_scene(wanted.scene)
    pipeline = wanted.pipeline or _pipeline_for(scene, machine, textured=image is not None)
    _check_scene(scene, pipeline, wanted, machine)
    _check_map(pipeline, wanted.map_)
    options = wanted.options(pipeline)
    if image is not None and options_type(pipeline).patches:
        options |= {"texture": image}
    elif image is not None:
        scene = load_scene(wanted.scene, texture=image)
    ours = machine or wanted.described(_machine_for(pipeline))
    width, height = wanted.size or (None, None)
    run = simulate(scene, pipeline, ours, width=width, height=height, camera=_camera(wanted, scene), **asked, **options)
    return run, _why(wanted, scene, pipeline, ours.identity.name)


def _camera(wanted: Wanted, scene: Scene) -> Any:
    """The view, from nearer where that is wanted."""
    if wanted.zoom == 1.0:
        return wanted.camera
    from tilestamp.simulator.scenes.camera_path import moved_camera
    from tilestamp.simulator.simulation import SIZE

    return moved_camera(read_camera(wanted.camera, scene), *(wanted.size or SIZE), wanted.zoom)


def _machine_for(pipeline: str) -> str:
    """The first machine that can run a pipeline."""
    return next(able_machines(pipeline, pipeline_options(pipeline, {})))


def _pipeline_for(scene: Scene, machine: Machine | None, *, textured: bool) -> str:
    """The first pipeline that can draw a scene, on the machine if one is named."""
    if scene.patches is not None:
        return PIPELINE
    if scene.splats is not None:
        return OF_SPLATS
    fitting = OF_TEXTURES if textured else OF_MESHES
    return next((name for name in fitting if machine is None or _can_run(name, machine)), fitting[0])


def _can_run(pipeline: str, machine: Machine) -> bool:
    try:
        check_launches(pipeline, pipeline_options(pipeline, {}), machine)
    except UnableError:
        return False
    return True


def _check_scene(scene: Scene, pipeline: str, wanted: Wanted, machine: Machine | None) -> None:
    """Refuse what the pipeline cannot draw, and name one that can."""
    kind, textured = options_type(pipeline), wanted.texture is not None
    if kind.splats != (scene.splats is not None):
        what = (
            f"draws {'' if kind.splats else 'no '}splats, and {scene.name} has {'none' if kind.splats else 'only them'}"
        )
    elif kind.patches and scene.patches is None:
        what = f"draws patches, and {scene.name} has only triangles"
    elif textured and not (kind.patches or kind.textures):
        what = "draws no textures"
    else:
        return
    other = _pipeline_for(scene, machine, textured=textured)
    ours = {"machine": _machine_for(other)} if machine is None else {}
    raise UnableError(f"the pipeline {pipeline} {what}; {other} can", pipeline=other, **ours)


def _check_map(pipeline: str, name: str | None) -> None:
    """Refuse a heat map that the pipeline does not make."""
    maps = list(options_type(pipeline).maps)
    if name is not None and name not in maps:
        has = f"{did_you_mean(name, maps)}; it has {', '.join(maps) or 'none'}"
        raise TilestampError(f"the pipeline {pipeline} draws no map of {name}{has}")


def _image(file: Path) -> NDArray[np.uint8]:
    """Read the image that is to be laid over the scene."""
    from tilestamp.simulator.scenes.images import read_image

    try:
        return read_image(file.read_bytes(), f"--texture {file}")
    except OSError as error:
        raise TilestampError(f"--texture {file}: cannot be read ({error.strerror or error})") from None


def _why(wanted: Wanted, scene: Scene, pipeline: str, machine: str) -> str:
    """Say what was chosen, where it is not what is usual."""
    said = []
    if wanted.pipeline is None and pipeline != PIPELINE:
        what = "splats" if scene.splats is not None else "triangles and no patches"
        said.append(f"{scene.name} has {what}, so {pipeline} draws it (--pipeline chooses another)")
    if wanted.machine is None and machine != USUAL:
        said.append(f"{USUAL} cannot run {pipeline}, so {machine} does (--machine chooses another)")
    return "; ".join(said)
