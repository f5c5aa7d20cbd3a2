"""``tilestamp render``: one picture, and the table of its stages."""

import json
import os
import re
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from tilestamp.experiments.commands.option_flags import given_options, literal, once, parted
from tilestamp.experiments.commands.render_output import as_json, map_path, print_run, write_map, write_png
from tilestamp.experiments.commands.terminal import progress
from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_folder
from tilestamp.simulator.pipelines import options_type
from tilestamp.simulator.run import Run

PIPELINE = "micropolygon"  # where none is named


def render(
    scene: str,
    /,
    *,
    pipeline: str = PIPELINE,
    machine: str = "gtx280",
    size: str = "1024x768",
    camera: str | None = None,
    fidelity: Literal["counts", "bounds", "schedule"] = "schedule",
    error: float = 0.0,
    seed: int = 0,
    counting: bool = True,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    map_: Annotated[str | None, Parameter(name="--map")] = None,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
    option: Annotated[tuple[str, ...], Parameter(name=["--option", "-O"], negative="")] = (),
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    **flags: str | bool | None,
) -> None:
    """Draw SCENE and print what each stage did and how long it would take.

    Parameters
    ----------
    scene
        A name (`tilestamp list scenes`) or a file: .bpt, .obj, .ply, .glb, .npz...
    pipeline
        See `tilestamp list pipelines`; `--pipeline NAME --help` shows its options.
    machine
        See `tilestamp list machines`, or a machine file.
    size
        WIDTHxHEIGHT in pixels.
    camera
        A view of the scene by name, or a JSON file (`FILE.json`, `FILE.json:KEY`).
    fidelity
        counts: no time; bounds: a roofline for each launch; schedule: units of work scheduled on the machine.
    error
        Relative error that will do, such as 0.01: expensive stages execute a random part of their blocks, every number
        gets its 95 % interval, and there is no picture.
    seed
        Seed of the random part that --error executes.
    counting
        Count what the machine does; without it there is a picture and no time.
    output
        PNG file for the picture.
    map_
        Also write a heat map of this counter beside the picture, such as tests, into
        FILE.COUNTER.png; each pipeline has its own.
    json_
        Print one JSON object instead of tables.
    option
        An option of the pipeline as NAME=VALUE (`tilestamp list options PIPELINE`); the flags below are the same.
    set_
        Change the machine for a what-if, SECTION.NAME=VALUE (`--set sm.count=60`).
    """
    width, height = parse_size(size)
    _check_output(output, map_)
    if error and output is not None:
        raise TilestampError("--error draws only part of the blocks, which makes no picture: leave out -o or --error")
    options = given_options(options_type(pipeline), flags, option)
    asked: dict[str, Any] = {"fidelity": fidelity, "error": error, "seed": seed, "counting": counting}
    asked |= {"picture": output is not None} | options
    with progress(f"drawing {scene}") as say:
        run = _simulate(scene, pipeline, machine, set_, (width, height), camera, asked)
        if run.counted or output is None:  # without counts there is only a picture
            say("pricing")
            _ = run.stages
    if map_ is not None and output is not None:
        write_map(run, map_, map_path(output, map_))
    if output is not None:
        write_png(run.image, output)
    if json_:
        sys.stdout.write(json.dumps(as_json(run)) + "\n")
    else:
        print_run(run, output, map_)


def _simulate(
    scene: str,
    pipeline: str,
    machine: str,
    changes: tuple[str, ...],
    size: tuple[int, int],
    camera: str | None,
    asked: dict[str, Any],
) -> Run:
    """Load the machine with its what-ifs and simulate."""
    from tilestamp.models.machine import altered, load_machine
    from tilestamp.simulator.simulation import simulate

    described = load_machine(machine)
    if changes:
        written = {name: literal(value) for name, value in once(map(parted, changes)).items()}
        described = altered(described, written, "assumed", "a what-if on the command line")
    return simulate(scene, pipeline, described, width=size[0], height=size[1], camera=camera, **asked)


def parse_size(size: str) -> tuple[int, int]:
    """Take ``1600x1200`` apart."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", size)
    if match is None:
        raise TilestampError(f"--size is WIDTHxHEIGHT in pixels, such as 1600x1200, not {size}")
    return int(match[1]), int(match[2])


def _check_output(output: Path | None, map_: str | None) -> None:
    """Refuse an output that could not be written, before anything is computed."""
    if output is None:
        if map_ is not None:
            raise TilestampError("--map writes beside the picture: give -o FILE.png too")
        return
    if output.suffix.lower() != ".png":
        raise TilestampError(f"-o {output}: pictures are written as .png")
    if not is_folder(output.parent):
        raise TilestampError(f"-o {output}: there is no folder {output.parent}")
    if is_folder(output):
        raise TilestampError(f"-o {output}: is a folder")
    if not os.access(output.parent, os.W_OK):
        raise TilestampError(f"-o {output}: the folder {output.parent} cannot be written to")
