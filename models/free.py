"""Free: the time of a launch if one thing cost nothing, priced anew and not subtracted.

Most things are costs of the machine, so a machine on which they are 0 (or a rate without end) answers. Two are not:

balance  SMs idle because there are fewer units than SMs. Free of it, each unit is cut into as many as keep all SMs
         busy: its work and its chain, a share on each SM.
tail     the last units run on while other places are empty. Free of it, all places end together.

Both are the schedule's; a roofline knows no tail.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from tilestamp.models.bounds import COLUMNS, HOLDS, Result, Term, bound_launch, longest
from tilestamp.models.demand import IN_THE_WAY
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.launch_prices import Opened
from tilestamp.models.machine import Machine
from tilestamp.models.price import opened
from tilestamp.models.schedule import Loads, crowd, holds, play, schedule_launch, together
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import traffic

MACHINE_TERMS = ("issue", "shared", "l1", "latency", "dram", "l2", "atomics", "start", "launch")
SCHEDULE_TERMS = ("balance", "tail")
_Numbers = dict[str, dict[str, tuple[str, ...]]]  # by term and section
_RATES: _Numbers = {
    "l1": {"memory": ("l1_bytes_per_clock", "l1_write_bytes_per_clock")},
    "dram": {"memory": ("dram_gb_per_s", "l2_gap_lines_per_clock")},
    "l2": {
        "memory": (
            "l2_bytes_per_clock",
            "l2_write_bytes_per_clock",
            "l2_read_lines_per_clock",
            "l2_write_lines_per_clock",
        )
    },
    "atomics": {
        "atomics": ("requests_per_clock", "unawaited_per_clock", "sm_requests_per_clock", "sm_unawaited_per_clock")
    },
    "start": {"launch": ("blocks_per_us",)},
}
_COSTS: _Numbers = {
    "issue": {"issue": (), "pipe": ()},  # all of the section
    "shared": {"memory": ("bank_pass_cycles",)},
    "l1": {"memory": ("l1_line_cycles",)},
    "latency": {"latency": ()},
    "atomics": {"atomics": ("unit_ns_per_request", "spread_ns_per_request", "conflict_ns")},
    "launch": {"launch": ("kernel_us",)},
}


def free_terms(machine: Machine) -> tuple[str, ...]:
    """All that can be free on a machine: terms of its price, balance and tail, units of its fixed-function pipe."""
    units = machine.fixed_function.per_clock if machine.fixed_function else ()
    return (*MACHINE_TERMS, *SCHEDULE_TERMS, *units)


def free_of(machine: Machine, term: str) -> Machine:
    """Return the machine on which ``term`` (no ``SCHEDULE_TERMS``) costs nothing: no machine file can say that."""
    changed: dict[str, Any] = {}
    for table, value in ((_RATES, math.inf), (_COSTS, 0.0)):
        for section, names in table.get(term, {}).items():
            part = changed.get(section, getattr(machine, section))
            changed[section] = structs.replace(part, **dict.fromkeys(names or part.__struct_fields__, value))
    pipe = machine.fixed_function
    if pipe is not None and term in pipe.per_clock:
        changed["fixed_function"] = structs.replace(pipe, per_clock=pipe.per_clock | {term: math.inf})
    return structs.replace(machine, **changed, changes=machine.changes | {term: ("", "free")})


def without(
    launches: Sequence[Launch | PipeLaunch], machine: Machine, timings: Sequence[Timing], term: str
) -> list[Timing]:
    """Price launches without ``balance`` or ``tail``, each at the fidelity that its timing has.

    Parameters
    ----------
    launches, timings : sequences of equal length
        Those of a frame, and what ``models.price`` made of them.
    machine : Machine
    term : {"balance", "tail"}
    """
    without_it = _balanced if term == "balance" else _level_ends
    return [
        without_it(opened(launch, machine, moved), timing, machine.sm.count) if isinstance(launch, Launch) else timing
        for launch, moved, timing in zip(launches, traffic(launches, machine), timings, strict=True)
    ]


def _balanced(whole: Opened, timing: Timing, sms: int) -> Timing:
    """Price units that are cut into as many as keep all SMs busy."""
    units, terms, row = whole.loads, whole.terms.copy(), np.zeros(COLUMNS)
    share = min(len(units.alone), units.sms) / sms
    terms[Term.BALANCE], terms[Term.LATENCY] = 0.0, terms[Term.LATENCY] * share
    units = units._replace(sm=units.sm * share, own=units.own * share, alone=units.alone * share, way=units.way * share)
    if timing.fidelity == "schedule":
        schedule_launch(units, play(units), terms, False, row)
    else:
        bound_launch(terms, units.way, row)
    return _timed(timing, float(row[Result.CYCLES]), int(row[Result.BOUND]))


def _level_ends(whole: Opened, timing: Timing, sms: int) -> Timing:
    """Price units of which none runs on alone."""
    if timing.fidelity != "schedule":
        return timing
    units, terms, end = whole.loads, whole.terms, level(whole.loads)
    beside = together(units, play(units), units.begun + end, IN_THE_WAY)
    cycles = max(longest(terms, units.way), beside)
    return _timed(timing, float(terms[Term.LAUNCH]) + cycles, holds(terms, cycles, 0.0, units.sms < sms))


def _timed(timing: Timing, cycles: float, bound: int) -> Timing:
    """The timing of a launch that takes ``cycles``."""
    milliseconds = timing.milliseconds * cycles / timing.cycles if timing.cycles else 0.0
    return replace(timing, cycles=cycles, milliseconds=milliseconds, bound=HOLDS[bound])


def level(units: Loads) -> float:
    """Cycles to the end of units of which none runs on alone: never above what ``models.schedule.play`` expects.

    As they share SMs with their neighbours, or one an SM, whichever is sooner.
    """
    if not len(units.alone):
        return 0.0
    return min(_level(units, crowd(units)[0], units.places), _level(units, units.alone, units.sms))


def _level(units: Loads, alone: NDArray[np.float64], places: int) -> float:
    """All places and SMs busy from the first unit to the end; the terms see to draws and to starts."""
    count = len(alone)
    return max(
        float(alone.sum()) / min(places, count), units.pace.start + float(units.sm.sum()) / min(units.sms, count)
    )
