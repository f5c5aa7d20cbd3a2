"""What a machine can launch: the blocks whose shape a pipeline's options decide, before anything is executed."""

from typing import Any

import msgspec

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine
from tilestamp.models.occupancy import residency
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.options import Options, choices, plain
from tilestamp.simulator.pipelines import pipeline_options

MANY = 6  # values that a sentence names one by one


def check_launches(pipeline: str, options: Options, machine: Machine) -> None:
    """Refuse options that make a block which the machine cannot launch.

    Raises
    ------
    TilestampError
        Saying what exceeds (threads, registers or shared memory), and which value of which option would do.
    """
    try:
        _reside(pipeline, options, machine)
    except TilestampError as error:
        cures = launchable_values(pipeline, options, machine).items()
        cure = ", or ".join(f"{name} {listed(values)}" for name, values in cures if values)
        raise TilestampError(f"{error}{'; it can launch ' if cure else ''}{cure}") from None


def _reside(pipeline: str, options: Options, machine: Machine) -> None:
    for work in options.launches(machine.simt):
        launch = load_mix(pipeline, machine.compute_capability).launch(work, machine.sm.warp_size)
        residency(machine, launch.block, launch.registers, launch.shared_bytes)


def launchable_values(pipeline: str, options: Options, machine: Machine) -> dict[str, list[Any]]:
    """Values of each option that a machine can launch, the others as they are; of options of which it cannot all."""
    given, found = plain(options), {}
    for field in msgspec.structs.fields(options):
        values = choices(field.type)
        can = [value for value in values if _can_launch(pipeline, given | {field.name: value}, machine)]
        if len(can) < len(values):
            found[field.name] = can
    return found


def _can_launch(pipeline: str, given: dict[str, Any], machine: Machine) -> bool:
    try:
        _reside(pipeline, pipeline_options(pipeline, given), machine)
    except TilestampError:
        return False
    return True


def listed(values: list[Any]) -> str:
    """Say values: one by one, or the first and last of many."""
    if len(values) > MANY:
        return f"{values[0]} to {values[-1]}"
    *first, last = map(str, values)
    return f"{', '.join(first)} or {last}" if first else last
