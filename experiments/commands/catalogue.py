"""``tilestamp list``: what there is, a line each; and what belongs to one pipeline, machine or scene."""

from typing import Annotated, Any, Literal, get_args

from cyclopts import Parameter

from tilestamp.experiments.commands.option_flags import option_table
from tilestamp.experiments.commands.outputs import write_json
from tilestamp.experiments.commands.tables import print_entries, print_words
from tilestamp.experiments.harness.registry import describe, experiment_names, is_slow
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import list_machines, load_machine
from tilestamp.simulator.launchable import launchable_values, listed
from tilestamp.simulator.pipelines import load_pipeline, options_type, pipeline_names, pipeline_options
from tilestamp.simulator.scenes import list_scenes, load_scene
from tilestamp.simulator.scenes.camera import Camera, FittedCamera, LookAt

All = Literal["scenes", "pipelines", "machines", "experiments"]
Kind = Literal[All, "options", "maps", "numbers", "views"]
OF = {"options": "PIPELINE", "maps": "PIPELINE", "numbers": "MACHINE", "views": "SCENE"}
Table = dict[str, dict[str, Any]]


def catalogue(
    kind: Kind | None = None,
    name: str | None = None,
    /,
    *,
    machine: str | None = None,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """List scenes, pipelines, machines or experiments; or options, maps, numbers or views of one of them.

    Parameters
    ----------
    kind
        What to list.
    name
        The pipeline whose options or maps are listed, the machine whose numbers, or the scene whose views.
    machine
        With options: say which values this machine can launch, where it cannot launch all.
    json_
        Print a JSON object instead of lines.
    """
    if kind is None:
        kinds = ", ".join(f"{each} {OF.get(each, '')}".strip() for each in get_args(Kind))
        raise TilestampError(f"say what to list: {kinds}")
    if (kind in OF) != (name is not None) or (machine and kind != "options"):
        wanted = f"tilestamp list {kind} {OF.get(kind, '')}".strip()
        raise TilestampError(f"write: {wanted}{'; --machine goes with options' if machine else ''}")
    if name is None:
        lines = entries(kind)  # type: ignore[arg-type]  # those of OF have a name
        write_json(lines) if json_ else print_entries(lines)
        return
    tables = {"maps": _maps, "numbers": _numbers, "views": _views}
    table = _options(name, machine) if kind == "options" else tables[kind](name)
    if json_:
        write_json(table)
        return
    columns = list(dict.fromkeys(column for row in table.values() for column in row))
    print_words([[key, *map(str, row.values())] for key, row in table.items()], [kind.removesuffix("s"), *columns])


def _options(pipeline: str, machine: str | None) -> Table:
    """What each option of a pipeline takes, on a machine, its default and what it is."""
    options = option_table(options_type(pipeline))
    default = pipeline_options(pipeline, {})
    for name, values in (launchable_values(pipeline, default, load_machine(machine)) if machine else {}).items():
        options[name]["takes"] += f"; {machine} can launch {listed(values) if values else 'none'}"
    return dict(options)


def _maps(pipeline: str) -> Table:
    return {name: {"what": what} for name, what in options_type(pipeline).maps.items()}


def _numbers(machine: str) -> Table:
    """Each number of a machine, what kind of number it is, and where it comes from."""
    described = load_machine(machine)
    return {
        key: {"value": described.number(key), "provenance": kind, "source": source}
        for key, (kind, source) in described.provenance.items()
    }


def _views(scene: str) -> Table:
    return {name: {"camera": _camera(view)} for name, view in load_scene(scene).views.items()}


def _camera(view: Camera) -> str:
    """Where a camera is, and what it looks at."""
    placed = view.look_at(4, 3) if isinstance(view, FittedCamera) else view
    if not isinstance(placed, LookAt):
        return "a matrix, model to clip space"
    eye, target = (", ".join(f"{value:.4g}" for value in point) for point in (placed.eye, placed.target))
    return f"from ({eye}) to ({target}), {placed.fov_degrees:g} degrees high"


def entries(kind: All) -> dict[str, str]:
    """Names of one kind, and what each is."""
    if kind == "scenes":
        return dict(list_scenes())
    if kind == "machines":
        return dict(list_machines())
    if kind == "experiments":
        return {name: describe(name) + (" [slow]" if is_slow(name) else "") for name in experiment_names()}
    return {name: (load_pipeline(name).__doc__ or "").strip().splitlines()[0] for name in pipeline_names()}
