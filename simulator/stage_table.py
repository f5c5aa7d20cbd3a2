"""The table of stages: launches gathered by stage, in the order of the pipeline."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.counters import Counter, by_name, counters_of
from tilestamp.models.error_model import error_interval
from tilestamp.models.events import INSTRUCTION_CLASSES, MachineEvent
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.simulator.work import FixedFunctionWork, Work


def stage_table(
    works: Sequence[Work | FixedFunctionWork],
    launches: Sequence[Launch | PipeLaunch],
    timings: Sequence[Timing],
    machine: Machine,
) -> dict[str, dict[str, Any]]:
    """Gather launches by stage.

    Parameters
    ----------
    works, launches, timings : sequences of equal length, in launch order
    machine : Machine
        On which they were priced.

    Returns
    -------
    dict of dict
        A row a stage; all have the same columns, not-a-number where a stage has nothing of the name.
    """
    stages: dict[str, list[tuple[Any, Any, Timing]]] = {}
    for part in zip(works, launches, timings, strict=True):
        stages.setdefault(part[0].stage, []).append(part)
    counters = declared(works)
    rows = {stage: _row(parts, machine, counters) for stage, parts in stages.items()}
    columns = dict.fromkeys(name for row in rows.values() for name in row)
    return {stage: {name: _builtin(row.get(name, np.nan)) for name in columns} for stage, row in rows.items()}


def _builtin(value: object) -> object:
    """A number of NumPy's as Python's own."""
    return value.item() if isinstance(value, np.generic) else value


def declared(works: Sequence[Work | FixedFunctionWork]) -> dict[str, Counter]:
    """What the stages declare, by name."""
    return by_name(counter for work in works for counter in work.counters)


def declared_columns(works: Sequence[Work | FixedFunctionWork], counters: Mapping[str, Counter]) -> dict[str, float]:
    """Columns of all that any stage declares, for one stage."""
    counts: dict[str, int] = {}
    for work in works:
        for event, counted in work.counts().items():
            counts[event] = counts.get(event, 0) + counted
    own = declared(works)
    columns: dict[str, float] = {}
    for name, counter in counters.items():
        if name in own:
            event = own[name].event
            columns |= own[name].values(counts, [each for work in works for each in work.units(event)])
        else:
            columns |= counter.values({}, [])
    return columns


def _machine(events: NDArray[np.float64]) -> dict[str, float]:
    """Columns of what the machine's events declare, for one stage."""
    counts = {event.name: round(float(events[event])) for event in MachineEvent}
    return {name: value for c in counters_of(MachineEvent) for name, value in c.values(counts, []).items()}


def _row(parts: list[tuple[Any, Any, Timing]], machine: Machine, counters: Mapping[str, Counter]) -> dict[str, Any]:
    """One stage: sums over its launches; occupancy and bound of its longest."""
    longest = max(parts, key=lambda part: part[2].milliseconds)[2]
    simt = [(work, launch) for work, launch, _ in parts if isinstance(launch, Launch)]
    events = sum((launch.events.sum(axis=0) for _, launch in simt), np.zeros(len(MachineEvent)))
    warp, timings = machine.sm.warp_size, [timing for _, _, timing in parts]
    error = error_interval(timings, machine)
    instructions = float(sum(events[event] for event in INSTRUCTION_CLASSES))
    return {
        "blocks": sum(launch.grid for _, launch in simt),
        "warps": sum(launch.grid * -(-launch.block // warp) for _, launch in simt),
        "instructions": round(instructions),
        "simd_efficiency": events[MachineEvent.LANES] / (warp * instructions) if instructions else np.nan,
        **declared_columns([work for work, _, _ in parts], counters),
        **_machine(events),
        "dram_bytes": sum(round(timing.dram_bytes) for timing in timings),
        "occupancy": longest.occupancy,
        "achieved_occupancy": longest.achieved,
        "residency": longest.residency,
        "cycles": sum(timing.cycles for timing in timings),
        "milliseconds": sum(timing.milliseconds for timing in timings),
        "low_milliseconds": sum(timing.low for timing in timings),
        "high_milliseconds": sum(timing.high for timing in timings),
        "error_low_milliseconds": error.low,
        "error_high_milliseconds": error.high,
        "bound": longest.bound,
        **_terms(timings),
    }


def _terms(timings: list[Timing]) -> dict[str, float]:
    """Milliseconds of each term of the time, a column each (``issue_ms``...)."""
    terms: dict[str, float] = {}
    for timing in timings:
        for name, milliseconds in timing.terms.items():
            terms[f"{name}_ms"] = terms.get(f"{name}_ms", 0.0) + milliseconds
    return terms
