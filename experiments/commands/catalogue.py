"""``tilestamp list``: what there is, a line each."""

import json
import sys
from typing import Annotated, Literal

from cyclopts import Parameter

from tilestamp.experiments.harness.registry import describe, experiment_names, is_slow
from tilestamp.models.machine import list_machines
from tilestamp.simulator.pipelines import load_pipeline, pipeline_names
from tilestamp.simulator.scenes import list_scenes

Kind = Literal["scenes", "pipelines", "machines", "experiments"]


def catalogue(kind: Kind, /, *, json_: Annotated[bool, Parameter(name="--json", negative="")] = False) -> None:
    """List scenes, pipelines, machines or experiments, each with one line of what it is.

    Parameters
    ----------
    kind
        What to list.
    json_
        Print a JSON object instead of lines.
    """
    lines = entries(kind)
    if json_:
        sys.stdout.write(json.dumps(lines) + "\n")
        return
    width = max(map(len, lines), default=0)
    for name, line in lines.items():
        sys.stdout.write(f"{name:{width}}  {line}\n")


def entries(kind: Kind) -> dict[str, str]:
    """Names of one kind, and what each is."""
    if kind == "scenes":
        return dict(list_scenes())
    if kind == "machines":
        return dict(list_machines())
    if kind == "experiments":
        return {name: describe(name) + (" [slow]" if is_slow(name) else "") for name in experiment_names()}
    return {name: (load_pipeline(name).__doc__ or "").strip().splitlines()[0] for name in pipeline_names()}
