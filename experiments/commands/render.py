"""``tilestamp render``: one picture, and the table of its stages."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter

from tilestamp.experiments.commands.draw import Wanted, draw
from tilestamp.experiments.commands.outputs import check_file, check_png, write_json
from tilestamp.experiments.commands.render_output import as_json, map_path, print_run, write_map, write_png
from tilestamp.experiments.commands.tables import print_lines
from tilestamp.experiments.commands.terminal import progress
from tilestamp.experiments.commands.why import print_why, why_json, write_tornado
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.run import Run
from tilestamp.simulator.sensitivity import Sensitivity


def render(
    scene: str,
    /,
    *,
    pipeline: str | None = None,
    machine: str | None = None,
    size: str | None = None,
    camera: str | None = None,
    zoom: float = 1.0,
    texture: Path | None = None,
    fidelity: Literal["counts", "bounds", "schedule"] = "schedule",
    counting: bool = True,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    map_: Annotated[str | None, Parameter(name="--map")] = None,
    columns: str = "",
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
    option: Annotated[tuple[str, ...], Parameter(name=["--option", "-O"], negative="")] = (),
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    why: Annotated[bool, Parameter(negative="")] = False,
    tornado: Path | None = None,
    trace: Path | None = None,
    timeline: Path | None = None,
    **flags: str | bool | None,
) -> None:
    """Draw SCENE and print what each stage did and how long it would take.

    Parameters
    ----------
    scene
        A name (`tilestamp list scenes`) or a file: .bpt, .obj, .ply, .glb, .npz...
    pipeline
        See `tilestamp list pipelines`; `--pipeline NAME --help` shows its options. If not given, micropolygon where the
        scene has patches, cudaraster where it has only triangles.
    machine
        See `tilestamp list machines`, or a machine file. If not given, gtx280, or the first that can run the pipeline.
    size
        WIDTHxHEIGHT in pixels; 1024x768, or that of a camera which has one, if not given.
    camera
        A view of the scene by name (`tilestamp list views SCENE`), or a JSON file (`FILE.json`, `FILE.json:KEY`).
    zoom
        2 puts the eye at half the distance from what the camera looks at.
    texture
        Image to lay over a mesh that has texture coordinates, or over each patch.
    fidelity
        counts: no time; bounds: a roofline for each launch; schedule: units of work scheduled on the machine.
    counting
        Count what the machine does; without it there is a picture and no time.
    output
        PNG file for the picture.
    map_
        Also write a heat map of this counter beside the picture, such as tests, into
        FILE.COUNTER.png; each pipeline has its own.
    columns
        Columns of the table: `all`, or names between commas; those that fit the terminal if not given.
    json_
        Print one JSON object instead of tables.
    option
        An option of the pipeline as NAME=VALUE (`tilestamp list options PIPELINE`); the flags below are the same.
    set_
        Change the machine for a what-if, SECTION.NAME=VALUE (`--set sm.count=60`).
    why
        Say what holds each stage and what would help: its time with each thing free, and what each number of the
        machine does.
    tornado
        PNG file for a plot of what each number of the machine does.
    trace
        File (.json.gz) for the schedule of all units as a Chrome trace, which Perfetto opens.
    timeline
        PNG file for the same as a picture: which SMs are taken over time.
    """
    if output is None and map_ is not None:
        raise TilestampError("--map writes beside the picture: give -o FILE.png too")
    if output is None and not counting:
        raise TilestampError("--no-counting leaves a picture and no time: give -o FILE.png too")
    for file, flag in ((output, "-o"), (tornado, "--tornado"), (timeline, "--timeline")):
        check_png(file, flag)
    if trace is not None:
        check_file(trace, "--trace", ".json.gz")
    if (why or tornado or trace or timeline) and (fidelity == "counts" or not counting):
        has_none = "--fidelity counts" if counting else "--no-counting"
        raise TilestampError(f"--why, --tornado, --trace and --timeline explain times: {has_none} has none")
    pixels = parse_size(size) if size else None
    wanted = Wanted(scene, pipeline, machine, pixels, camera, zoom, texture, map_, set_, flags, option)
    asked: dict[str, Any] = {"fidelity": fidelity, "counting": counting}
    with progress(f"drawing {scene}") as say:
        run, chosen = draw(wanted, picture=output is not None, **asked)
        if run.counted:  # without counts there is only a picture
            say("pricing")
            _ = run.stage_rows
        explained = _explained(run, why, tornado, trace, timeline)
    if map_ is not None and output is not None:
        write_map(run, map_, map_path(output, map_))
    if output is not None:
        write_png(run.image, output)
    if json_:
        write_json(as_json(run) | ({"why": why_json(explained.found)} if explained.found else {}))
        return
    print_run(run, output, map_, columns)
    print_lines(*explained.lines, *filter(None, [chosen]))
    if explained.found is not None and why:
        print_why(run, explained.found)


class _Explained(NamedTuple):
    """What moves a run, where that was asked for, and a line for each file that was written."""

    found: Sensitivity | None
    lines: list[str]


def _explained(run: Run, why: bool, tornado: Path | None, trace: Path | None, timeline: Path | None) -> _Explained:
    found = run.sensitivity() if why or tornado is not None else None
    lines = []
    if found is not None and tornado is not None:
        write_tornado(run, found, tornado)
        lines.append(f"tornado: {tornado}")
    if trace is not None or timeline is not None:
        from tilestamp.experiments.commands.trace import draw_timeline, write_schedule
    if trace is not None:
        lines.append(write_schedule(run, trace))
    if timeline is not None:
        draw_timeline(run, timeline)
        lines.append(f"timeline: {timeline}")
    return _Explained(found, lines)


def parse_size(size: str) -> tuple[int, int]:
    """Take ``1600x1200`` apart."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", size)
    if match is None:
        raise TilestampError(f"--size is WIDTHxHEIGHT in pixels, such as 1600x1200, not {size}")
    return int(match[1]), int(match[2])
