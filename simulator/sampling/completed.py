"""The end of a sampled run: stages of which a part does not tell enough run in full, and the run says what was done."""

import time
from dataclasses import replace

import numpy as np

from tilestamp.simulator.run import Run
from tilestamp.simulator.sampling.executor import SampledExecutor


def completed(run: Run, execute: SampledExecutor) -> Run:
    """Run all units of the launches, the least sure first, whose samples do not tell the frame's time within the error.

    Parameters
    ----------
    run : Run
    execute : SampledExecutor
        Which ran its frame.
    """
    if not execute.parts:
        why = (
            "a sample would cost more, or tell too little" if execute.too_small else f"{run.pipeline} cannot be sampled"
        )
        return _noted(run, f"everything ran: {why}")
    run = replace(run, sampled={"units": execute.units})
    if run.fidelity != "counts":
        _, begin = run.timings, time.process_time()
        sure = run.milliseconds_interval.relative <= run.error
        execute.spent += time.process_time() - begin
        run = run if sure else _finished(run, execute)
    run.sampled["seconds"] = execute.spent
    return run


def _finished(run: Run, execute: SampledExecutor) -> Run:
    """Run all units of the least sure launches, until the others tell the time within the error."""
    half = np.array([found["milliseconds"].half_width for found in run.launch_intervals])
    order = np.argsort(-half)
    left = np.cumsum(half[order][::-1] ** 2)[::-1]  # of the variance, before each is run in full
    chosen = order[(left > (run.error * run.milliseconds) ** 2) & (half[order] > 0)]
    works = list(run.frame.works)
    for index in chosen:
        works[index] = execute.finished(index)
    kernels = dict.fromkeys(works[index].kernel for index in sorted(chosen))
    run = _noted(run, f"all units ran of {', '.join(kernels)}: part of them did not tell enough")
    return replace(run, frame=replace(run.frame, works=works), sampled={"units": execute.units})


def _noted(run: Run, note: str) -> Run:
    return replace(run, note="; ".join(filter(None, (run.note, note))))
