"""Share of 95 % intervals that hold the full run's number: ``python -m tests.benchmarks.interval_coverage SCENE ...``.

Every pipeline that samples, on four machines, over seeds. The full run executes once; a seed then looks up the rows of
its sample. Constants of ``simulator.sampling`` were chosen on teapot and spot: other scenes are the test. Launches
before the sampled one run in full, and stand in no table here.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.sampling import executor as sampling
from tilestamp.simulator.scenes import load_scene, read_camera

MACHINES = ("gtx280", "gtx480", "gtx680", "h200")
PIPELINES: dict[str, dict[str, Any]] = {"micropolygon": {"bound": 3}, "cudaraster": {"msaa": 4}}
SIZE = 1024, 768
SEEDS = 40
ERROR = 0.05


class Recorded:
    """A stage that ran in full: units are looked up."""

    def __init__(self, stage: Any, *inputs: Any, **options: Any) -> None:
        self.named, self.work = stage.inputs(*inputs, **options), stage.work
        self.rows, self.found = stage.run(*inputs, **options)[1], stage.known(**self.named)

    def inputs(self) -> dict[str, Any]:
        """As they were."""
        return self.named

    def known(self, **_: Any) -> Any:
        """As it was found."""
        return self.found

    def run(self, *, units: Any, **_: Any) -> tuple[None, Any]:
        """Rows of some units."""
        return None, self.rows[units]


class Recorder(Executor):
    """Runs everything, and keeps the stage that others may sample."""

    recorded: Recorded

    def last(self, stage: Any, *inputs: Any, **options: Any) -> Any:
        """Run and record it."""
        self.recorded = Recorded(stage, *inputs, **options)
        return super().last(stage, *inputs, **options)


class Coverage(NamedTuple):
    """Of one pipeline, machine and scene."""

    time: float  # share of seeds whose interval of the launch's time held the full run's
    width: float  # mean half-width of it, relative
    count: float  # share of all intervals of counts that held
    worst: float  # the same of the worst count ...
    name: str  # ... which is this
    units: float  # share of the units that ran


def coverage(pipeline: str, machine: str, scene: str, seeds: int = SEEDS, first: int = 0) -> Coverage:
    """Run one pipeline in full, and as many samples of it as there are seeds."""
    described, what = load_machine(machine), load_scene(scene)
    execute = Recorder(picture=False)
    matrix = read_camera("default", what).matrix(*SIZE)
    chosen = pipeline_options(pipeline, PIPELINES[pipeline])
    frame = load_pipeline(pipeline)(what, matrix, *SIZE, described.simt, chosen, execute)
    full = Run(scene, pipeline, described, *SIZE, "schedule", {}, replace(frame, works=frame.works[-1:]))
    held = list(_held(full, execute.recorded, range(first, first + seeds)))
    counts = {name: np.mean([counts[name] for _, _, counts, _ in held]) for name in full.counts}
    worst = min(counts, key=counts.__getitem__)
    time, width, units = (float(np.mean([row[k] for row in held])) for k in (0, 1, 3))
    return Coverage(time, width, float(np.mean(list(counts.values()))), float(counts[worst]), worst, units)


def _held(full: Run, recorded: Recorded, seeds: range) -> Iterator[tuple[bool, float, dict[str, bool], float]]:
    """Whether each interval of each seed holds: time and its width, counts; and the share of units."""
    true = full.milliseconds
    for seed in seeds:
        execute = sampling.SampledExecutor(ERROR, seed, full.pipeline, full.machine)
        execute.last(recorded)  # type: ignore[arg-type]
        if not execute.parts:
            raise ValueError("everything runs: too few units for the machine")
        ((ran, units),) = execute.units.values()
        run = replace(full, frame=replace(full.frame, works=execute.works), sampled={"units": execute.units})
        time = run.milliseconds_interval
        counts = {n: e.low - 1 <= full.counts[n] <= e.high + 1 for n, e in run.counts_interval.items()}
        yield time.low <= true * (1 + 1e-9) and true <= time.high * (1 + 1e-9), time.relative, counts, ran / units


def main(scenes: list[str]) -> None:
    """Print the table."""
    sampling.PAYS = 0.0
    for scene in scenes:
        for pipeline in PIPELINES:
            for machine in MACHINES:
                try:
                    c = coverage(pipeline, machine, scene)
                except (
                    TilestampError,
                    ValueError,
                ) as refused:  # triangles alone, or a machine that the original cannot use
                    sys.stdout.write(f"{scene:14} {pipeline:13} {machine:7} {refused}\n")
                    continue
                sys.stdout.write(
                    f"{scene:14} {pipeline:13} {machine:7} time {c.time:4.0%} (width {c.width:.2%})  counts "
                    f"{c.count:4.0%}, worst {c.worst:4.0%} {c.name}  units {c.units:.1%}\n"
                )
                sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:] or ["teapot", "spot"])
