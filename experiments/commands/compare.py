"""``tilestamp compare``: runs beside each other, stage by stage."""

import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from tilestamp.experiments.commands.compared import Compared, from_run, print_comparison, saved, write_plot
from tilestamp.experiments.commands.draw import PIPELINE
from tilestamp.experiments.commands.option_flags import given_options, literal, parted
from tilestamp.experiments.commands.outputs import check_png, write_json
from tilestamp.experiments.commands.render import parse_size
from tilestamp.experiments.commands.terminal import Progress, progress
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.simulator.pipelines import options_type, pipeline_options
from tilestamp.simulator.run import Run

MOST = 12  # runs beside each other


def compare(
    scenes: tuple[str, ...],
    /,
    *,
    pipeline: Annotated[tuple[str, ...], Parameter(negative="")] = (PIPELINE,),
    machine: Annotated[tuple[str, ...], Parameter(negative="")] = ("gtx280",),
    size: Annotated[tuple[str, ...], Parameter(negative="")] = ("1024x768",),
    camera: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    fidelity: Annotated[tuple[Literal["bounds", "schedule"], ...], Parameter(negative="")] = ("schedule",),
    option: Annotated[tuple[str, ...], Parameter(name=["--option", "-O"], negative="")] = (),
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Compare runs stage by stage: times, shares, ratios, bounds, and how the term that bounds changed.

    What is given more than once is compared, in every combination: `--machine gtx280 --machine h200`,
    `-O tile=8 -O tile=16`, `--set sm.count=30 --set sm.count=60`, two scenes. All are compared with the first.

    Parameters
    ----------
    scenes
        Scenes by name or file; or runs that `tilestamp render ... --json` printed into files (.json).
    pipeline
        See `tilestamp list pipelines`.
    machine
        See `tilestamp list machines`, or a machine file.
    size
        WIDTHxHEIGHT in pixels.
    camera
        A view of the scene by name, or a JSON file.
    fidelity
        As of `tilestamp render`.
    option
        An option of the pipelines as NAME=VALUE.
    set_
        Change the machines, SECTION.NAME=VALUE.
    output
        PNG file for a plot.
    json_
        Print one JSON object instead of tables.
    """
    check_png(output)
    with progress("comparing") as say:
        files = [name for name in scenes if name.endswith(".json")]
        drawn = [name for name in scenes if name not in files]
        found = [saved(Path(name)) for name in files]
        if drawn:
            axes: dict[str, Sequence[Any]] = {
                "scene": drawn,
                "pipeline": pipeline,
                "size": size,
                "camera": camera or (None,),
            }
            axes |= {f"-O {name}": values for name, values in _gathered(option).items()}
            axes |= {"fidelity": fidelity, "machine": machine}
            axes |= {f"--set {name}": values for name, values in _gathered(set_).items()}
            found += list(_runs(axes, say))
    if len(found) < 2:
        raise TilestampError(
            "a comparison needs two runs: give --machine, --pipeline, -O or --set twice, or two files of render --json"
        )
    if output is not None:
        write_plot(found, output)
    if json_:
        write_json([run.plain() for run in found])
    else:
        print_comparison(found)
        sys.stdout.writelines([f"plot: {output}\n"] if output else [])


def _gathered(assignments: Sequence[str]) -> dict[str, list[str]]:
    """Values by name of ``NAME=VALUE``, each that was given."""
    found: dict[str, list[str]] = {}
    for name, value in map(parted, assignments):
        found.setdefault(name.replace("-", "_"), []).append(value)
    return found


def _runs(axes: dict[str, Sequence[Any]], say: Progress) -> Iterator[Compared]:
    """Each combination; what differs in the machine's numbers alone is executed once."""
    combinations = [dict(zip(axes, values, strict=True)) for values in product(*axes.values())]
    if len(combinations) > MOST:
        raise TilestampError(f"{len(combinations)} combinations are too many to compare: at most {MOST}")
    for chosen in combinations:  # what is wrong with the last is said before the first is drawn
        _machine(chosen), _options(chosen), parse_size(chosen["size"])
    several = [name for name, values in axes.items() if len(values) > 1]
    before: tuple[Any, Run] | None = None
    for done, chosen in enumerate(combinations):
        name = ", ".join(_said(key, chosen[key]) for key in several) or str(chosen["machine"])
        say.count(done, len(combinations))
        say(name)
        counted = [value for key, value in chosen.items() if key != "machine" and not key.startswith("--set ")]
        known = before[1] if before is not None and before[0] == counted else None
        run = _priced(chosen, known)
        before = counted, run
        yield from_run(run, name)


def _said(key: str, value: object) -> str:
    """A value, with the name of the number or option that it is of."""
    kind, _, name = key.partition(" ")
    return f"{name}={value}" if kind.startswith("-") else str(value)


def _priced(chosen: dict[str, Any], known: Run | None) -> Run:
    """Price a run that was counted already, or simulate."""
    from tilestamp.simulator.simulation import simulate

    machine = _machine(chosen)
    if known is not None:
        try:
            return known.on(machine)
        except TilestampError:  # counted otherwise there
            pass
    width, height = parse_size(chosen["size"])
    return simulate(
        chosen["scene"],
        chosen["pipeline"],
        machine,
        width=width,
        height=height,
        camera=chosen["camera"],
        fidelity=chosen["fidelity"],
        picture=False,
        **_options(chosen),
    )


def _machine(chosen: dict[str, Any]) -> Machine:
    """The machine of a combination, with its what-ifs."""
    machine = load_machine(chosen["machine"])
    changes = {key.partition(" ")[2]: literal(value) for key, value in chosen.items() if key.startswith("--set ")}
    return altered(machine, changes, "assumed", "a what-if on the command line") if changes else machine


def _options(chosen: dict[str, Any]) -> dict[str, Any]:
    """The pipeline's options of a combination, checked."""
    assignments = [f"{key[3:]}={value}" for key, value in chosen.items() if key.startswith("-O ")]
    given = given_options(options_type(chosen["pipeline"]), {}, assignments)
    pipeline_options(chosen["pipeline"], given)
    return given
