"""``tilestamp list``: what there is, a line each."""

from typing import Annotated, Literal

from cyclopts import Parameter

from tilestamp.experiments.commands.option_flags import option_table
from tilestamp.experiments.commands.outputs import write_json
from tilestamp.experiments.commands.tables import print_entries, print_words
from tilestamp.experiments.harness.registry import describe, experiment_names, is_slow
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import list_machines, load_machine
from tilestamp.simulator.launchable import launchable_values, listed
from tilestamp.simulator.pipelines import load_pipeline, options_type, pipeline_names, pipeline_options
from tilestamp.simulator.scenes import list_scenes

Kind = Literal["scenes", "pipelines", "machines", "experiments", "options"]


def catalogue(
    kind: Kind,
    pipeline: str | None = None,
    /,
    *,
    machine: str | None = None,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """List scenes, pipelines, machines or experiments, or the options of a pipeline, and what each is.

    Parameters
    ----------
    kind
        What to list.
    pipeline
        The pipeline whose options are listed.
    machine
        With options: say which values this machine can launch, where it cannot launch all.
    json_
        Print a JSON object instead of lines.
    """
    if (kind == "options") != (pipeline is not None) or (machine and not pipeline):
        raise TilestampError(
            "write: tilestamp list options PIPELINE, or tilestamp list and scenes, pipelines, machines or experiments;"
            " --machine goes with options"
        )
    if pipeline is not None:
        _list_options(pipeline, machine, json_)
        return
    lines = entries(kind)
    if json_:
        write_json(lines)
        return
    print_entries(lines)


def _list_options(pipeline: str, machine: str | None, json_: bool) -> None:
    """Print what each option of a pipeline takes, on a machine, its default and what it is."""
    options = option_table(options_type(pipeline))
    default = pipeline_options(pipeline, {})
    for name, values in (launchable_values(pipeline, default, load_machine(machine)) if machine else {}).items():
        options[name]["takes"] += f"; {machine} can launch {listed(values) if values else 'none'}"
    if json_:
        write_json(options)
        return
    rows = [[name, *option.values()] for name, option in options.items()]
    print_words(rows, ["option", "takes", "default", "what it is"])


def entries(kind: Kind) -> dict[str, str]:
    """Names of one kind, and what each is."""
    if kind == "scenes":
        return dict(list_scenes())
    if kind == "machines":
        return dict(list_machines())
    if kind == "experiments":
        return {name: describe(name) + (" [slow]" if is_slow(name) else "") for name in experiment_names()}
    return {name: (load_pipeline(name).__doc__ or "").strip().splitlines()[0] for name in pipeline_names()}
