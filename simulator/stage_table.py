"""The table of stages: launches gathered by stage, in the order of the pipeline."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.models.events import INSTRUCTION_CLASSES, MachineEvent
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.timing import Timing
from tilestamp.simulator.sampling.estimate import Estimate
from tilestamp.simulator.work import FixedFunctionWork, Work

if TYPE_CHECKING:
    import pandas as pd

COUNTED = {  # column of the report: machine event
    "load_transactions": MachineEvent.LOAD_TRANSACTIONS,
    "store_transactions": MachineEvent.STORE_TRANSACTIONS,
    "atomics": MachineEvent.ATOMIC_LANES,
    "atomic_conflicts": MachineEvent.ATOMIC_CONFLICTS,
}


def stage_table(
    works: Sequence[Work | FixedFunctionWork],
    launches: Sequence[Launch | PipeLaunch],
    timings: Sequence[Timing],
    warp: int,
) -> "pd.DataFrame":
    """Gather launches by stage.

    Parameters
    ----------
    works, launches, timings : sequences of equal length, in launch order
    warp : int
        Lanes in a warp.

    Returns
    -------
    DataFrame, indexed by stage
    """
    import pandas as pd

    stages = list(dict.fromkeys(work.stage for work in works))
    rows = [
        _row([part for part in zip(works, launches, timings, strict=True) if part[0].stage == stage], warp)
        for stage in stages
    ]
    return pd.DataFrame(rows, index=pd.Index(stages, name="stage"))


def _row(parts: list[tuple[Any, Any, Timing]], warp: int) -> dict[str, Any]:
    """One stage: sums over its launches; occupancy and bound of its longest."""
    longest = max(parts, key=lambda part: part[2].milliseconds)[2]
    simt = [(work, launch) for work, launch, _ in parts if isinstance(launch, Launch)]
    machine = sum((launch.events.sum(axis=0) for _, launch in simt), np.zeros(len(MachineEvent)))
    instructions = float(sum(machine[event] for event in INSTRUCTION_CLASSES))
    counts = [work.counts() for work, _, _ in parts]
    tests, hits = (sum(count.get(name, 0) for count in counts) for name in ("SAMPLE_TESTS", "SAMPLE_HITS"))
    return {
        "blocks": sum(launch.grid for _, launch in simt),
        "warps": sum(launch.grid * -(-launch.block // warp) for _, launch in simt),
        "instructions": round(instructions),
        "simd_efficiency": machine[MachineEvent.LANES] / (warp * instructions) if instructions else np.nan,
        "sample_tests": tests,
        "sample_hits": hits,
        "ste": hits / tests if tests else np.nan,
        **{name: round(float(machine[event])) for name, event in COUNTED.items()},
        "dram_bytes": sum(round(timing.dram_bytes) for _, _, timing in parts),
        "occupancy": longest.occupancy,
        "cycles": sum(timing.cycles for _, _, timing in parts),
        "milliseconds": sum(timing.milliseconds for _, _, timing in parts),
        "bound": longest.bound,
        **_chosen([timing for _, _, timing in parts]),
        **_terms([timing for _, _, timing in parts]),
    }


def _chosen(timings: list[Timing]) -> dict[str, str]:
    """What ``auto`` chose and why: of the launches that were escalated, the longest one's reason."""
    if not any(timing.why for timing in timings):
        return {}
    played = [timing for timing in timings if timing.fidelity == "schedule"]
    told = max(played or timings, key=lambda timing: timing.milliseconds)
    some = 0 < len(played) < len(timings)
    return {
        "fidelity": f"{len(played)} of {len(timings)} schedule" if some else told.fidelity,
        "why": f"{told.kernel}: {told.why}" if some else told.why,
    }


def _terms(timings: list[Timing]) -> dict[str, float]:
    """Milliseconds of each term of the time, a column each (``issue_ms``...)."""
    terms: dict[str, float] = {}
    for timing in timings:
        for name, milliseconds in timing.terms.items():
            terms[f"{name}_ms"] = terms.get(f"{name}_ms", 0.0) + milliseconds
    return terms


def interval_table(intervals: Mapping[tuple[str, str], Estimate]) -> "pd.DataFrame":
    """Ends of the intervals of each stage, a column each (``milliseconds_low``, ``milliseconds_high``...)."""
    import pandas as pd

    rows: dict[str, dict[str, float]] = {}
    for (stage, name), estimate in intervals.items():
        if stage != "frame":
            rows.setdefault(stage, {}).update({f"{name}_low": estimate.low, f"{name}_high": estimate.high})
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("stage")
