"""A run: a frame that was executed once, to be priced on other machines, explained and looked at."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.price import Fidelity
from tilestamp.simulator import run_views
from tilestamp.simulator.manifest import machine_manifest, mix_manifest, software
from tilestamp.simulator.priced_frame import PricedFrame
from tilestamp.simulator.prices import Machines, Prices, machines_of, prices_of
from tilestamp.simulator.sensitivity import Sensitivity, sensitivity
from tilestamp.simulator.work import Work

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class Run(PricedFrame):
    """One frame, executed once, priced on ``machine``; ``on`` prices it elsewhere without executing again.

    A run is equal to itself only: ``run.counts == other.counts`` says whether two did the same work.
    """

    def __repr__(self) -> str:
        """Say in a line what was drawn, by what, on what, and how long it takes."""
        return f"<Run: {run_views.heading(self)}>"

    def _repr_html_(self) -> str:
        """The picture, the table of stages and what each limit alone would take, for a notebook."""
        return run_views.card(self)

    def plot(self, kind: run_views.Kind = "stages", *, counter: str = "", axes: "Axes | None" = None) -> "Axes":
        """Draw one view of the run.

        Parameters
        ----------
        kind : {"stages", "terms", "map", "timeline"}
            Milliseconds by stage; what each limit alone would take in each stage; a heat map of a counter over the
            screen; which SMs are taken, over time.
        counter : str
            Of a map: one of ``run.frame.maps``; the first if not given.
        axes : matplotlib Axes, optional
            To draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib Axes

        Raises
        ------
        TilestampError
            No such view or counter, or a run without what the view shows.
        """
        return run_views.draw(self, kind, axes, counter)

    def on(self, machine: Machine | str | Path, fidelity: Fidelity | None = None) -> "Run":
        """Price the same work on another machine.

        Raises
        ------
        TilestampError
            A machine on which the work would have been counted otherwise: another warp size, coalescing, banks or
            merging of atomics; another number of SMs, where a kernel launched a block for each.
        """
        machine = load_machine(machine)
        self._check_counted_for(machine)
        return replace(self, machine=machine, fidelity=fidelity or self.fidelity)

    def prices(self, machines: Machines, *, skip: bool = False) -> Prices:
        """Price the same work on many machines, at the run's fidelity.

        Parameters
        ----------
        machines : iterable of Machine, name or path; or mapping of str to array, (machines,)
            A mapping, or a DataFrame, has changed numbers of the run's own machine by dotted name:
            ``{"sm.clock_mhz": [1000.0, 1500.0]}``.
        skip : bool
            A machine on which the run has no price gets none (``Prices.refusals`` says why) instead of an error.

        Returns
        -------
        Prices
            (machines, launches): each price is that of ``on(machine)``.

        Raises
        ------
        TilestampError
            A number that no machine has; without ``skip`` also what ``on`` and ``timings`` refuse.
        """
        self.check_counted()
        chosen = machines_of(machines, self.machine)
        return prices_of(self.frame.works, chosen, self._launches_on, self.fidelity, skip=skip)

    def _launches_on(self, machine: Machine) -> list[Launch | PipeLaunch]:
        """Launches on another machine; errors as of ``on``."""
        self._check_counted_for(machine)
        return self.frame.mixed(self.pipeline, machine).launches

    def _check_counted_for(self, machine: Machine) -> None:
        """Refuse a machine that would have counted otherwise."""
        persistent = any(isinstance(work, Work) and work.persistent for work in self.frame.works)
        if differences := self.machine.simt.differences(machine.simt, persistent=persistent):
            told = ", ".join(differences)
            raise TilestampError(f"this run was not counted for {machine.name} ({told}): simulate again on it")

    def sensitivity(self) -> Sensitivity:
        """What moves the time: every number of the machine, and each thing that costs time, priced anew.

        Raises
        ------
        TilestampError
            A run without times.
        """
        self.check_counted()
        return sensitivity(self.launches, self.machine, self.fidelity, partial(self.prices, skip=True))

    def manifest(self) -> dict[str, Any]:
        """All that made the run, as plain data: versions, digests, every option, machine changes, camera, command."""
        origin = self.origin
        return software() | {
            "date": origin.date if origin else None,
            "scene": {"name": self.scene, "digest": origin.scene_digest if origin else None, "note": self.note},
            "pipeline": self.pipeline,
            "options": self.options,
            "machine": machine_manifest(self.machine),
            "mix": mix_manifest(self.pipeline, self.machine),
            "camera": origin.matrix.tolist() if origin else None,
            "width": self.width,
            "height": self.height,
            "fidelity": self.fidelity,
        }
