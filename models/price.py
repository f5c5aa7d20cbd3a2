"""Price: the launches of a frame, in order, on one machine or on many, at the fidelity requested.

One machine is a batch of one: ``models.launch_prices`` has the only formula.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.batch import Batch
from tilestamp.models.bounds import HOLDS, TERMS, Result
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import moved as moved_number
from tilestamp.models.fixed_function import check_pipe, pipe_time
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.launch_prices import Opened, launch_loads
from tilestamp.models.machine import Machine, note_machine
from tilestamp.models.occupancy import Residency, residency
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic, traffic
from tilestamp.models.used import collecting

Fidelity = Literal["counts", "bounds", "schedule"]
FIDELITIES: tuple[Fidelity, ...] = ("counts", "bounds", "schedule")
ENDS = [int(end) for end in (Result.CYCLES, Result.LOW, Result.HIGH)]
NAN = float("nan")


class Times(NamedTuple):
    """Times of launches on machines.

    Parameters
    ----------
    milliseconds, low, high : ndarray, (machines, launches), float64
        As of ``Timing``.
    bounds : ndarray, (machines, launches), str
    """

    milliseconds: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    bounds: NDArray[np.str_]


def price(
    launches: Sequence[Launch | PipeLaunch],
    machine: Machine,
    fidelity: Fidelity = "schedule",
    moved: Sequence[Traffic] | None = None,
) -> list[Timing]:
    """Price the launches of one frame.

    Parameters
    ----------
    launches : sequence of Launch or PipeLaunch
        In launch order: what a launch leaves in the cache, a later one finds there.
    machine : Machine
    fidelity : {"counts", "bounds", "schedule"}
        No time at all; a roofline for each launch; units of work scheduled on the SMs.
    moved : sequence of Traffic, optional
        Bytes of each launch, if they are not to be those of ``tilestamp.models.traffic``.

    Returns
    -------
    list of Timing
        One for each launch.

    Raises
    ------
    TilestampError
        An unknown fidelity, or a block that the machine cannot launch.
    """
    _check(fidelity)
    batch = Batch(taken([machine]))
    if moved is None:
        moved = traffic(launches, batch.machines[0])
    (machine,) = batch.machines
    if fidelity == "counts":
        return [_untimed(launch, bytes_, machine) for launch, bytes_ in zip(launches, moved, strict=True)]
    bytes_ = np.reshape(moved, (-1, 1, len(Traffic._fields)))
    rows = batch.prices(launches, bytes_, scheduled=fidelity == "schedule")[:, 0].tolist()
    return [_timing(*each, machine, fidelity) for each in zip(launches, moved, rows, strict=True)]


def prices(
    launches: Sequence[Launch | PipeLaunch], machines: Sequence[Machine], fidelity: Fidelity = "schedule"
) -> Times:
    """Price the launches of one frame on many machines (from ``taken``), as arrays; errors as of ``price``."""
    _check(fidelity)
    batch = Batch(machines)
    times = no_times((len(machines), len(launches)), "none")
    if fidelity == "counts":
        return times
    moved = batch.traffic(launches)
    rows = batch.prices(launches, moved, scheduled=fidelity == "schedule").swapaxes(0, 1)
    for into, column in zip(times, ENDS, strict=False):
        into[batch.order] = rows[:, :, column] / batch.clock_hz[:, np.newaxis] * 1e3
    times.bounds[batch.order] = np.array(HOLDS)[rows[:, :, Result.BOUND].astype(np.intp)]
    for place, launch in enumerate(launches):
        if isinstance(launch, PipeLaunch):
            for which, machine, bytes_ in zip(batch.order, batch.machines, moved[place].tolist(), strict=True):
                found = pipe_time(launch, machine, Traffic(*bytes_))
                for into, value in zip(times[:3], (found.milliseconds, found.low, found.high), strict=True):
                    into[which, place] = value
                times.bounds[which, place] = found.bound
    return times


def no_times(shape: tuple[int, int], bound: str) -> Times:
    """Times that are not known yet, (machines, launches)."""
    milliseconds, low, high = np.full((3, *shape), np.nan)
    return Times(milliseconds, low, high, np.full(shape, bound, "U32"))


def opened(launch: Launch, machine: Machine, moved: Traffic) -> Opened:
    """What the price of one launch is made of: demands, terms, loads.

    ``models.schedule.play`` works the loads off; parameters and errors as of ``price``.
    """
    batch = Batch([machine])
    return launch_loads(launch, batch.numbers[0], batch.facts([launch], np.array([[moved]]))[0, 0])


def check_prices(launches: Sequence[Launch | PipeLaunch], machine: Machine) -> None:
    """Refuse what ``price`` refuses, without a price.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch, or a pipe that it has not.
    """
    for launch in launches:
        if isinstance(launch, Launch):
            _held(launch, machine)
        else:
            check_pipe(launch, machine)


def taken(machines: Sequence[Machine]) -> Sequence[Machine]:
    """Note that prices are made on machines, and take their fitted numbers as they are moved now."""
    if not (moved_number() or collecting()):
        return machines
    machines = list(machines)
    for machine in machines:
        note_machine(machine)
    return [machine.as_moved for machine in machines]


def _check(fidelity: str) -> None:
    if fidelity not in FIDELITIES:
        raise TilestampError(f"no fidelity {fidelity!r}; there are {', '.join(FIDELITIES)}")


def _timing(
    launch: Launch | PipeLaunch, bytes_: Traffic, row: list[float], machine: Machine, fidelity: Fidelity
) -> Timing:
    """What is to be said of a launch, by its row of prices."""
    if isinstance(launch, PipeLaunch):
        return pipe_time(launch, machine, bytes_)
    held = _held(launch, machine)
    cycles, low, high = (row[place] for place in ENDS)
    clock_hz = machine.clock_hz
    details = {"resident_blocks": float(held.blocks)}
    if fidelity == "schedule":
        details |= {"busy_sms": row[Result.BUSY_SMS], "tail_cycles": row[Result.TAIL_CYCLES]}
    return Timing(
        stage=launch.stage,
        kernel=launch.kernel,
        term_cycles=dict(zip(TERMS, row, strict=False)),
        cycles=cycles,
        milliseconds=cycles / clock_hz * 1e3,
        bound=HOLDS[int(row[Result.BOUND])],
        occupancy=held.occupancy,
        dram_bytes=bytes_.dram_bytes,
        l2_bytes=bytes_.l2_bytes,
        details=details,
        fidelity=fidelity,
        low=low / clock_hz * 1e3,
        high=high / clock_hz * 1e3,
        residency=_steps(launch, machine, held),
        achieved=_achieved(launch, machine, row[Result.HELD], held) if fidelity == "schedule" else NAN,
    )


def _achieved(launch: Launch, machine: Machine, units: float, held: Residency) -> float:
    """Share of an SM's warps that are resident in the mean, where it holds so many units in the mean."""
    warps = held.warps / held.blocks if launch.shape.block_is_unit else 1.0
    return min(held.occupancy, units * warps / machine.sm.max_warps)


def _untimed(launch: Launch | PipeLaunch, moved: Traffic, machine: Machine) -> Timing:
    """Everything but time."""
    occupancy = _held(launch, machine).occupancy if isinstance(launch, Launch) else 0.0
    totals = moved.dram_bytes, moved.l2_bytes
    return Timing(launch.stage, launch.kernel, {}, NAN, NAN, "none", occupancy, *totals, fidelity="counts")


def _held(launch: Launch, machine: Machine) -> Residency:
    """What an SM holds of a launch; errors as of ``residency``."""
    return residency(machine, launch.block, launch.registers, launch.shared_bytes)


def _steps(launch: Launch, machine: Machine, held: Residency) -> str:
    """Say where a time may step: blocks that an SM holds, and the rounds in which all SMs take the grid."""
    told = f"{held.blocks} an SM by {held.limit}"
    if launch.dispatch != "blocks":
        return told
    return f"{told}, {launch.grid / (held.blocks * machine.sm.count):.2f} rounds"
