"""Fixed function: a pipe of units, each with a rate; the slowest one sets the time.

A launch of the pipe says how many items pass each unit, by the unit's name in the machine file
(``[fixed_function.per_clock]``); units overlap perfectly, and DRAM carries the bytes beside them.
"""

from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.machine_parts import FixedFunction
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic


def pipe_time(launch: PipeLaunch, machine: Machine, traffic: Traffic) -> Timing:
    """Price one pass: launch overhead and the slowest of units and DRAM; errors as of ``check_pipe``."""
    pipe = check_pipe(launch, machine)
    ratio = machine.sm.clock_mhz / pipe.clock_mhz  # terms are in cycles of the SMs, like those of every launch
    terms = {name: count / pipe.per_clock[name] * ratio for name, count in launch.items.items()}
    terms["dram"] = traffic.dram_bytes / machine.dram_bytes_per_cycle
    slowest = max(terms.values())
    terms["launch"] = machine.launch.kernel_us * machine.sm.clock_mhz
    cycles = terms["launch"] + slowest
    return Timing(
        stage=launch.stage,
        kernel=launch.kernel,
        term_cycles=terms,
        cycles=cycles,
        milliseconds=cycles / machine.clock_hz * 1e3,
        low=cycles / machine.clock_hz * 1e3,
        high=cycles / machine.clock_hz * 1e3,
        bound=max(terms, key=lambda name: terms[name]),
        occupancy=0.0,
        dram_bytes=traffic.dram_bytes,
        l2_bytes=traffic.l2_bytes,
        fidelity="bounds",
    )


def check_pipe(launch: PipeLaunch, machine: Machine) -> FixedFunction:
    """The pipe that a pass goes through.

    Raises
    ------
    TilestampError
        A machine without fixed function, or without a unit that the launch names.
    """
    pipe = machine.fixed_function
    if pipe is None:
        raise TilestampError(f"the machine {machine.name} describes no fixed-function pipe")
    unknown = [name for name in launch.items if name not in pipe.per_clock]
    if unknown:
        raise TilestampError(
            f"the machine {machine.name} has no fixed-function unit {unknown[0]!r}; it has {', '.join(pipe.per_clock)}"
        )
    return pipe
