"""Price: the launches of a frame, in order, on a machine, at the fidelity requested."""

from collections.abc import Sequence
from typing import Literal

from tilestamp.models.auto import auto
from tilestamp.models.bounds import bounds
from tilestamp.models.errors import TilestampError
from tilestamp.models.fixed_function import pipe_time
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.occupancy import residency
from tilestamp.models.schedule import schedule
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic, traffic
from tilestamp.models.used import note

Fidelity = Literal["counts", "bounds", "auto", "schedule"]
FIDELITIES: tuple[Fidelity, ...] = ("counts", "bounds", "auto", "schedule")


def price(
    launches: Sequence[Launch | PipeLaunch], machine: Machine, fidelity: Fidelity = "schedule", error: float = 0.0
) -> list[Timing]:
    """Price the launches of one frame.

    Parameters
    ----------
    launches : sequence of Launch or PipeLaunch
        In launch order: what a launch leaves in the cache, a later one finds there.
    machine : Machine
    fidelity : {"counts", "bounds", "auto", "schedule"}
        No time at all; a roofline for each launch; the cheaper of its neighbours, launch by launch
        (``tilestamp.models.auto``); units of work played on the SMs.
    error : float
        Relative error of time that ``auto`` may make against ``schedule``; 0 for ``tilestamp.models.auto.ERROR``.

    Returns
    -------
    list of Timing
        One for each launch.

    Raises
    ------
    TilestampError
        An unknown fidelity, or a block that the machine cannot launch.
    """
    if fidelity not in FIDELITIES:
        raise TilestampError(f"no fidelity {fidelity!r}; there are {', '.join(FIDELITIES)}")
    note("machines", machine.name, machine.digest)
    machine = machine.as_moved
    traffics = traffic(launches, machine)
    if fidelity == "auto":
        return auto(launches, machine, traffics, error)
    return [_one(launch, machine, bytes_, fidelity) for launch, bytes_ in zip(launches, traffics, strict=True)]


def _one(launch: Launch | PipeLaunch, machine: Machine, bytes_: Traffic, fidelity: Fidelity) -> Timing:
    if fidelity == "counts":
        return _counts(launch, machine, bytes_)
    if isinstance(launch, PipeLaunch):
        return pipe_time(launch, machine, bytes_)
    return schedule(launch, machine, bytes_) if fidelity == "schedule" else bounds(launch, machine, bytes_)


def _counts(launch: Launch | PipeLaunch, machine: Machine, bytes_: Traffic) -> Timing:
    """Everything but time."""
    nan = float("nan")
    occupancy = 0.0
    if isinstance(launch, Launch):
        occupancy = residency(machine, launch.block, launch.registers, launch.shared_bytes).occupancy
    totals = bytes_.dram_bytes, bytes_.l2_bytes
    return Timing(launch.stage, launch.kernel, {}, nan, nan, "none", occupancy, *totals, fidelity="counts")
