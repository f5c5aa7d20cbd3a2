"""What a machine can run: what its hardware has, and blocks that it can launch, before anything is executed."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

import msgspec

from tilestamp.models.errors import TilestampError, UnableError
from tilestamp.models.machine import Machine, list_machines, load_machine
from tilestamp.models.occupancy import residency
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.options import Options, choices, plain
from tilestamp.simulator.pipelines import pipeline_options
from tilestamp.simulator.scenes.scene import Scene

MANY = 6  # values that a sentence names one by one
MOST = 256  # values of an option that are tried one by one
PROPOSED = 3  # machines that a sentence names
FIRST = ("gtx280", "gtx480", "h200")  # machines that are proposed before others: of the papers, and measured


def check_launches(pipeline: str, options: Options, machine: Machine) -> None:
    """Refuse a machine that lacks what the pipeline runs on, and options that make a block which it cannot launch.

    Raises
    ------
    UnableError
        Saying what it lacks or what exceeds (threads, registers or shared memory), which value of which option would
        do, and which machines can run it as it is.
    """
    try:
        _check(pipeline, options, machine)
    except TilestampError as error:
        cures = launchable_values(pipeline, options, machine).items()
        cure = ", or ".join(f"{name} {listed(values)}" for name, values in cures if values)
        able = list(able_machines(pipeline, options))
        others = f"; {listed(able[:PROPOSED])} can run it" if able else ""
        instead = {"machine": able[0]} if able else {}
        raise UnableError(f"{error}{'; it can launch ' if cure else ''}{cure}{others}", **instead) from None


def check_scene(pipeline: str, options: Options, scene: Scene) -> None:
    """Refuse splats where a pipeline draws triangles or patches, and those where it draws splats."""
    if options.splats and scene.splats is None:
        raise UnableError(f"the pipeline {pipeline} draws splats, and {scene.name} has none")
    if scene.splats is not None and not options.splats:
        raise UnableError(
            f"the pipeline {pipeline} draws no splats, and {scene.name} has nothing else; splat can", pipeline="splat"
        )


def able_machines(pipeline: str, options: Options) -> Iterator[str]:
    """Machines of the package that can run a pipeline with some options: well known ones first."""
    for name in chain(FIRST, _others()):
        if _can_launch(pipeline, plain(options), load_machine(name)):
            yield name


def _others() -> Iterator[str]:
    """Less well known machines; their files are read only where they are needed."""
    yield from (name for name in list_machines() if name not in FIRST)


def _check(pipeline: str, options: Options, machine: Machine) -> None:
    if options.votes and not machine.simt.votes:
        raise TilestampError(
            f"{machine.name} (compute capability {machine.compute_capability}) cannot run {pipeline}, which votes over"
            " warps of 32 and needs 2.0 or later"
        )
    if options.fixed_function and machine.fixed_function is None:
        raise TilestampError(f"the machine {machine.name} describes no fixed-function pipe, which {pipeline} runs on")
    for work in options.launches(machine.simt):
        launch = load_mix(pipeline, machine.compute_capability).launch(work, machine.sm.warp_size)
        residency(machine, launch.block, launch.registers, launch.shared_bytes)


def launchable_values(pipeline: str, options: Options, machine: Machine) -> dict[str, list[Any]]:
    """Values of each option that a machine can launch, the others as they are; of options of which it cannot all.

    Options of more than ``MOST`` values are capacities of buffers: no launch's shape depends on them.
    """
    given, found = plain(options), {}
    for field in msgspec.structs.fields(options):
        values = choices(field.type)
        if len(values) > MOST:
            continue
        can = [value for value in values if _can_launch(pipeline, given | {field.name: value}, machine)]
        if len(can) < len(values):
            found[field.name] = can
    return found


def _can_launch(pipeline: str, given: dict[str, Any], machine: Machine) -> bool:
    try:
        _check(pipeline, pipeline_options(pipeline, given), machine)
    except TilestampError:
        return False
    return True


def listed(values: list[Any]) -> str:
    """Say values: one by one, or the first and last of many."""
    if len(values) > MANY:
        return f"{values[0]} to {values[-1]}"
    *first, last = map(str, values)
    return f"{', '.join(first)} or {last}" if first else last
