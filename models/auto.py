"""Auto: launch by launch the cheapest fidelity whose error is known to be small enough.

Every launch is priced by its roofline first, and ``models.fidelity_bound`` proves how much later its schedule can end.
It stays there when that is within the requested error of its own time. Of the others, those stay too that matter least:
from the smallest possible gap upwards, while all gaps together stay within the requested error of the frame. So a
small launch may be off by more than the error requested (its row says by how much), the frame may not. The rest is
scheduled, and each launch says why.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import Pricing, longest, pricing_of, roofline
from tilestamp.models.fidelity_bound import latest_end
from tilestamp.models.fixed_function import pipe_time
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.schedule import Loads, loads, played
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic

ERROR = 0.05  # of time, where none is requested: below what separates the models from silicon


def auto(
    launches: Sequence[Launch | PipeLaunch], machine: Machine, traffic: Sequence[Traffic], error: float = 0.0
) -> list[Timing]:
    """Price the launches of one frame, each as cheaply as ``error`` allows.

    Parameters
    ----------
    launches : sequence of Launch or PipeLaunch
    machine : Machine
    traffic : sequence of Traffic
        The bytes of each.
    error : float
        Relative; ``ERROR`` if 0. The frame's time is at most this far below that of ``schedule``, and so is each
        launch's unless it says that it is too small to matter.

    Returns
    -------
    list of Timing
        With ``fidelity``, ``why`` and ``error_bound``.
    """
    rough = [_Rough(launch, machine, bytes_) for launch, bytes_ in zip(launches, traffic, strict=True)]
    error = error or ERROR
    kept = _kept(np.array([r.timing.cycles for r in rough]), np.array([r.most for r in rough]), error)
    total = sum(r.timing.cycles for r in rough)
    return [r.stay(error, total) if keep else r.escalate() for r, keep in zip(rough, kept, strict=True)]


def _kept(least: NDArray[np.float64], most: NDArray[np.float64], error: float) -> NDArray[np.bool_]:
    """Tell which launches stay at their roofline."""
    gap = most - least
    kept: NDArray[np.bool_] = gap <= error * most
    for index in np.argsort(gap, kind="stable"):
        if not kept[index]:
            kept[index] = True
            if gap[kept].sum() > error * np.where(kept, most, least).sum():
                kept[index] = False
                break
    return kept


class _Rough:
    """One launch at its roofline, and how late it can end."""

    def __init__(self, launch: Launch | PipeLaunch, machine: Machine, traffic: Traffic) -> None:
        self.pricing: Pricing | None = None
        if isinstance(launch, PipeLaunch):  # rates of units: the same at every fidelity
            self.timing = pipe_time(launch, machine, traffic)
            self.most = self.timing.cycles
            return
        self.pricing = pricing_of(launch, machine, traffic)
        self.units: Loads = loads(self.pricing)
        self.timing = roofline(self.pricing)
        roof = longest(self.pricing.terms, self.pricing.units)
        self.most = self.pricing.terms["launch"] + max(roof, latest_end(self.units))

    def stay(self, error: float, frame: float) -> Timing:
        """Keep the roofline."""
        bound = 1.0 - self.timing.cycles / self.most if self.most else 0.0
        if self.pricing is None:
            return replace(self.timing, why="fixed function", error_bound=0.0)
        share = (self.most - self.timing.cycles) / frame
        why = f"at most {bound:.1%} low" if bound <= error else f"small: at most {share:.1%} of the frame low"
        return replace(self.timing, why=why, error_bound=bound)

    def escalate(self) -> Timing:
        """Schedule it."""
        assert self.pricing is not None  # noqa: S101 - a pipe has no gap, so it stays
        bound = 1.0 - self.timing.cycles / self.most
        return replace(played(self.pricing, self.units), why=f"bounds up to {bound:.0%} low", error_bound=0.0)
