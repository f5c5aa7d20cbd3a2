"""A frame with a price: the picture, what each stage did, how long it would take, and how sure each number is."""

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.counters import Counter
from tilestamp.models.error_model import Interval, error_interval
from tilestamp.models.errors import TilestampError
from tilestamp.models.events import MachineEvent
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.price import Fidelity, price
from tilestamp.models.remembered import priced_property
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic, traffic
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.manifest import Origin, note_run
from tilestamp.simulator.sampling import intervals
from tilestamp.simulator.sampling.estimate import Estimate, Floats
from tilestamp.simulator.stage_table import declared, stage_table
from tilestamp.simulator.work import Work

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class PricedFrame:
    """One frame, executed once, priced on ``machine``."""

    scene: str
    pipeline: str
    machine: Machine
    width: int
    height: int
    fidelity: Fidelity
    options: dict[str, Any]
    """All of the pipeline, defaults included, as plain values."""
    frame: Frame
    note: str = ""
    error: float = 0.0
    sampled: dict[str, Any] = field(default_factory=dict)
    """Empty where everything ran. ``units``: (executed, all) by kernel; ``seconds``: of CPU time, for that."""
    counted: bool = True
    """Whether the machine's work was counted: with ``counting=False`` there is a picture, and nothing to price."""

    origin: Origin | None = None

    def __post_init__(self) -> None:
        """Note it for the manifest of whoever collects."""
        settings = (self.width, self.height, self.fidelity, self.error, self.options)
        note_run(self.scene, self.origin, self.pipeline, self.machine, settings)

    def check_counted(self) -> None:
        """Raise TilestampError where nothing was counted."""
        if not self.counted:
            raise TilestampError("nothing was counted, so there is no time; ask with counting=True")

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) uint8, row 0 the top row."""
        return self._drawn(self.frame.image)

    @property
    def depth(self) -> NDArray[Any]:
        """Depth, (H, W), in the pipeline's own format."""
        return self._drawn(self.frame.depth)

    def _drawn(self, pixels: NDArray[Any]) -> NDArray[Any]:
        if pixels.size:
            return pixels
        if self.error:
            raise TilestampError("a sampled run draws no picture; ask with error=0")
        raise TilestampError("only numbers were asked for; ask with picture=True")

    @property
    def triangle_ids(self) -> NDArray[np.int32] | None:
        """Input index of the visible triangle, (H, W) int32, row 0 the top row, -1 where nothing was drawn."""
        return self.frame.triangle_ids

    @property
    def launches(self) -> list[Launch | PipeLaunch]:
        """One for each kernel launch, in machine events."""
        self.check_counted()
        return self.frame.mixed(self.pipeline, self.machine).launches

    def _launch(self, work: Work) -> Launch:
        """Price events in instructions."""
        return self.frame.mixed(self.pipeline, self.machine).launch(work)

    @priced_property
    def timings(self) -> list[Timing]:
        """Time of each launch, in launch order; empty terms at fidelity ``counts``."""
        return price(self.launches, self.machine, self.fidelity)

    @priced_property
    def stages(self) -> "pd.DataFrame":
        """One row a stage, in the order of the pipeline: counts, rates, cycles, milliseconds, bound."""
        import pandas as pd

        return pd.DataFrame.from_dict(self.stage_rows, orient="index").rename_axis("stage")

    @priced_property
    def stage_rows(self) -> dict[str, dict[str, Any]]:
        """The table ``stages`` as plain values, by stage and column: pandas takes longer to load than a small frame."""
        intervals = self.intervals if self.sampled else {}
        return stage_table(self.frame.works, self.launches, self.timings, self.machine, intervals)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Every event of every stage, ``{"stage.EVENT": int}``."""
        self.check_counted()
        counts: dict[str, int] = {}
        for work in self.frame.works:
            for name, count in work.counts().items():
                key = f"{work.stage}.{name}"
                counts[key] = counts.get(key, 0) + count
        return counts

    @property
    def counters(self) -> dict[str, Counter]:
        """What its stages declare for reports, by name: titles and kinds of columns of ``stages``."""
        return declared(self.frame.works)

    @property
    def milliseconds(self) -> float:
        """The frame: its launches one after another."""
        return float(sum(timing.milliseconds for timing in self.timings))

    @property
    def error_interval(self) -> Interval:
        """Milliseconds between which the frame lies on a real machine in 95 of 100 cases (``models.error_model``)."""
        return error_interval(self.timings, self.machine)

    @priced_property
    def intervals(self) -> dict[tuple[str, str], Estimate]:
        """Value, low and high of 95 % intervals by stage (``frame``: all) and number.

        Numbers are ``milliseconds``, ``instructions`` and the counts that stages declare (``sample_tests``,
        ``sample_hits``); what was not sampled has an interval of no width.
        """
        parts: dict[tuple[str, str], list[Estimate]] = {}
        for work, found in zip(self.frame.works, self.launch_intervals, strict=True):
            for name, estimate in found.items():
                parts.setdefault((work.stage, name), []).append(estimate)
                parts.setdefault(("frame", name), []).append(estimate)
        return {key: intervals.add(estimates) for key, estimates in parts.items()}

    @priced_property
    def launch_intervals(self) -> list[dict[str, Estimate]]:
        """The numbers of ``intervals`` of each launch, in launch order."""
        return [self._intervals(index) for index in range(len(self.launches))]

    def _intervals(self, index: int) -> dict[str, Estimate]:
        """Of one launch."""
        work, launch, timing = self.frame.works[index], self.launches[index], self.timings[index]
        counts = intervals.count_intervals(work)
        known = {name: intervals.exactly(0) for name, counter in self.counters.items() if counter.kind == "count"}
        known |= {counter.name: counts[counter.event] for counter in work.counters if counter.kind == "count"}
        if isinstance(work, Work) and isinstance(launch, Launch):
            ran = self._ran(work)
            known["instructions"] = intervals.instructions(work, launch, ran)
            changed = partial(self._changed, index)
            known["milliseconds"] = (
                intervals.exactly(timing.milliseconds)
                if ran is None
                else intervals.milliseconds(launch, timing, work, ran, self.machine, changed)
            )
        else:
            known["milliseconds"] = intervals.exactly(timing.milliseconds)
        return known

    def _ran(self, work: Work) -> Launch | None:
        """Price the units that ran, where not all did."""
        if work.sample is None or work.sample.complete:
            return None
        return self._launch(replace(work, table=work.sample.sampled, streams=(), atomic_requests=None))

    def _changed(self, index: int, share: Floats, columns: tuple[int, ...]) -> Timing:
        """Time of the ``index``-th launch, were what is estimated of each unit larger by a share of it."""
        work, launch, moved = self.frame.works[index], self.launches[index], self._traffic[index]
        assert isinstance(work, Work) and isinstance(launch, Launch) and work.sample is not None  # noqa: S101, PT018
        change = work.table * share[:, None]
        change[:, list(work.sample.exact)] = 0.0
        priced = self._launch(replace(work, table=change, streams=()))  # type: ignore[arg-type]  # events are linear
        events = launch.events.copy()
        events[:, columns] += priced.events[:, columns]
        launch = replace(launch, events=events)
        if work.sample.streams is not None and MachineEvent.LOAD_BYTES in columns:
            launch = replace(launch, streams=work.sample.streams(change.sum(axis=0)))
            launches = [*self.launches[:index], launch, *self.launches[index + 1 :]]
            moved = traffic(launches, self.machine)[index]
        return price([launch], self.machine, self.fidelity, [moved])[0]

    @cached_property
    def _traffic(self) -> list[Traffic]:
        """Bytes of each launch."""
        return traffic(self.launches, self.machine)

    @cached_property
    def counts_interval(self) -> dict[str, Estimate]:
        """The 95 % interval of each of ``counts``."""
        parts: dict[str, list[Estimate]] = {}
        for work in self.frame.works:
            for name, estimate in intervals.count_intervals(work).items():
                parts.setdefault(f"{work.stage}.{name}", []).append(estimate)
        return {key: intervals.add(estimates) for key, estimates in parts.items()}

    @property
    def milliseconds_interval(self) -> Estimate:
        """The frame's time and its 95 % interval."""
        return self.intervals["frame", "milliseconds"]
