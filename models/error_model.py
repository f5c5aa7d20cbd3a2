"""How far a predicted time may be from what a GPU takes: a factor by the term that holds, from residuals.

``residuals.toml`` is written by ``experiments/calibration/residuals.py`` from all kernel times measured on one H200,
and, for machines on which no kernel was ever measured, from the published times of whole frames that nothing was fitted
to. A factor is a conformal quantile: the ``ceil((n + 1) * 0.95)``-th smallest of n ratios of the larger to the smaller
of measured and modelled, so 95 % of further times of the same kind lie within it, whatever their distribution. Terms
with too few times to have one take that of all together.

Launches of one frame are taken to err together: the interval of a sum is the sum of the intervals.
"""

import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing

PATH = Path(__file__).parent / "residuals.toml"
ALL = "all"
ELSEWHERE = "elsewhere"


class Interval(NamedTuple):
    """Milliseconds between which 95 % of such times lie."""

    low: float
    high: float


def error_interval(timings: Iterable[Timing], machine: Machine) -> Interval:
    """Where the time of some launches of one frame lies, with 95 % probability.

    Parameters
    ----------
    timings : iterable of Timing
    machine : Machine
        A machine on which nothing was measured, or with other numbers, has the factor of the published times.
    """
    factors = [(timing.milliseconds, factor(timing.bound, machine)) for timing in timings]
    return Interval(sum(ms / times for ms, times in factors), sum(ms * times for ms, times in factors))


def was_measured(machine: Machine) -> bool:
    """Whether kernels were measured on it, as it is."""
    return machine.name in residuals() and not machine.changes


def factor(bound: str, machine: Machine) -> float:
    """Within which 95 % of the times that a term holds were, measured over modelled or modelled over measured."""
    if not was_measured(machine):
        return residuals()[ELSEWHERE][ALL]
    seen = residuals()[machine.name]
    return seen.get(bound, seen[ALL])


@cache
def residuals() -> dict[str, dict[str, float]]:
    """Factors by machine and by term."""
    tables = tomllib.loads(PATH.read_text("utf-8"))
    return {machine: {bound: entry["factor"] for bound, entry in terms.items()} for machine, terms in tables.items()}
