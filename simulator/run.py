"""A run: the picture, what each stage did, and how long it would take."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from models.fixed_function import PipeLaunch
from models.launch import Launch
from models.machine import Machine, load_machine
from models.price import Fidelity, price
from models.timing import Timing
from simulator.frame import Frame
from simulator.mix import load_mix
from simulator.stage_table import stage_table
from simulator.work import FixedFunctionWork, Work

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Run:
    """One frame, executed once, priced on ``machine``; ``on`` prices it elsewhere without executing again."""

    scene: str
    pipeline: str
    machine: Machine
    width: int
    height: int
    fidelity: Fidelity
    options: dict[str, Any]
    frame: Frame
    note: str = ""

    @property
    def image(self) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) uint8, row 0 the top row."""
        return self.frame.image

    @property
    def depth(self) -> NDArray[Any]:
        """Depth, (H, W), in the pipeline's own format."""
        return self.frame.depth

    @property
    def triangle_ids(self) -> NDArray[np.int32] | None:
        """Input index of the visible triangle, (H, W) int32, row 0 the top row, -1 where nothing was drawn."""
        return self.frame.triangle_ids

    @cached_property
    def launches(self) -> list[Launch | PipeLaunch]:
        """One for each kernel launch, in machine events."""
        if not any(isinstance(work, Work) for work in self.frame.works):  # fixed function alone needs no mix
            return [work.launch() for work in self.frame.works if isinstance(work, FixedFunctionWork)]
        return [self._launch(work) if isinstance(work, Work) else work.launch() for work in self.frame.works]

    def _launch(self, work: Work) -> Launch:
        """Price events in instructions; a pipeline that is fixed function throughout has no mix."""
        return load_mix(self.pipeline, self.machine.compute_capability).launch(work, self.machine.sm.warp_size)

    @cached_property
    def timings(self) -> list[Timing]:
        """Time of each launch, in launch order; empty terms at fidelity ``counts``."""
        return price(self.launches, self.machine, self.fidelity)

    @cached_property
    def stages(self) -> "pd.DataFrame":
        """One row a stage, in the order of the pipeline: counts, rates, cycles, milliseconds, bound."""
        return stage_table(self.frame.works, self.launches, self.timings, self.machine.sm.warp_size)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Every event of every stage, ``{"stage.EVENT": int}``."""
        counts: dict[str, int] = {}
        for work in self.frame.works:
            for name, count in work.counts().items():
                key = f"{work.stage}.{name}"
                counts[key] = counts.get(key, 0) + count
        return counts

    @property
    def milliseconds(self) -> float:
        """The frame: its launches one after another."""
        return float(sum(timing.milliseconds for timing in self.timings))

    def on(self, machine: Machine | str, fidelity: Fidelity | None = None) -> "Run":
        """Price the same work on another machine (of the same SIMT shape for counts to be its own)."""
        machine = load_machine(machine) if isinstance(machine, str) else machine
        return replace(self, machine=machine, fidelity=fidelity or self.fidelity)
