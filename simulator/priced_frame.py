"""A frame with a price: the picture, what each stage did, how long it would take, and how sure each number is."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.counters import Counter
from tilestamp.models.error_model import Interval, error_interval
from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.price import Fidelity, price
from tilestamp.models.remembered import priced_property
from tilestamp.models.timing import Timing
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.manifest import Origin, note_run
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
    counted: bool = True
    """Whether the machine's work was counted: with ``counting=False`` there is a picture, and nothing to price."""

    origin: Origin | None = None

    def __post_init__(self) -> None:
        """Note it for the manifest of whoever collects."""
        settings = (self.width, self.height, self.fidelity, self.options)
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
        return stage_table(self.frame.works, self.launches, self.timings, self.machine)

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
