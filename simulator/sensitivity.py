"""Sensitivity: what each number of the machine, and each thing that costs time, is to a frame and its stages.

Every time here is priced anew on a changed machine, none is a difference of others; ``simulator.why`` says it in words.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from tilestamp.models.errors import TilestampError
from tilestamp.models.free import SCHEDULE_TERMS, free_of, free_terms, without
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine, altered
from tilestamp.models.price import Fidelity, price
from tilestamp.models.timing import Timing
from tilestamp.simulator.prices import Machines, Prices

if TYPE_CHECKING:
    import pandas as pd

NEAR = 0.02  # relative change on both sides of a number for a derivative
FAR = 0.10  # relative change for what a user would notice; whole numbers by at least 1
UNITS = (
    "unit",
    "unit_bytes",
    "granularity",
    "line_bytes",
    "fetch_bytes",
)  # ends of names of what hardware has in powers of 2
FRAME = "frame"  # the row of all stages together
Times = dict[str, float]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What moves the time of a run.

    Parameters
    ----------
    numbers : DataFrame
        A row for each number of the machine and each stage (``frame``: all): ``number``, ``stage``, ``value``; the
        ``elasticity`` d log time / d log number by a central difference over 2 % on both sides (NaN of whole numbers,
        which step); ``lower``, ``higher``: the number 10 % lower and higher, a whole number by at least 1, a unit of
        allocation halved and doubled; ``less``, ``more``: the time there over the time now, NaN where no machine has
        such a number, or a block does not fit.
    free : DataFrame
        Milliseconds of each stage (``frame``: all) as it is (``now``), and with each term free (``models.free``).
    limits : DataFrame
        By stage: ``milliseconds``; the ``bound`` of its longest launch; what ``holds`` it, which is the term that would
        take most off if it were free; its milliseconds ``without`` that, and the bound of its longest launch then
        (``next``).
    fixed : tuple of str
        Numbers that were not changed: the counts depend on them, so another run answers, or no machine has one nearby.
    zero : tuple of str
        Numbers that are 0 here: ``--set`` changes them, a percentage does not.
    """

    numbers: "pd.DataFrame"
    free: "pd.DataFrame"
    limits: "pd.DataFrame"
    fixed: tuple[str, ...]
    zero: tuple[str, ...]


def sensitivity(
    launches: Sequence[Launch | PipeLaunch], machine: Machine, fidelity: Fidelity, prices: Callable[[Machines], Prices]
) -> Sensitivity:
    """Price launches on machines of which one number is another, and on machines on which one thing is free.

    Parameters
    ----------
    launches : sequence of Launch or PipeLaunch
        Of one frame.
    machine : Machine
    fidelity : {"bounds", "schedule"}
    prices : callable
        Prices of the frame on machines, NaN on one that it has none on.

    Raises
    ------
    TilestampError
        At fidelity ``counts``: there is no time.
    """
    import pandas as pd

    if fidelity == "counts":
        raise TilestampError("counts alone have no time that a number could change; ask for another fidelity")
    now = price(launches, machine, fidelity)
    values = {key: machine.number(key) for key in machine.provenance}
    numbers = {key: value for key, value in values.items() if isinstance(value, int | float) and value}
    found = _changed(machine, numbers, prices)
    rows = [row for key, times in found.items() for row in _rows(key, numbers[key], _by_stage(now), times)]
    freed = _freed(launches, machine, now, prices)
    free = pd.DataFrame({"now": _by_stage(now)} | {term: _by_stage(timings) for term, timings in freed.items()})
    fixed = tuple(key for key in numbers if key not in found)
    zero = tuple(key for key, value in values.items() if value == 0)
    return Sensitivity(pd.DataFrame(rows), free.rename_axis("stage"), _limits(free, now, freed), fixed, zero)


def _by_stage(launches: Sequence["Timing | Priced"]) -> Times:
    """Milliseconds by stage, and of the frame."""
    times = {FRAME: 0.0}
    for launch in launches:
        for name in (FRAME, launch.stage):
            times[name] = times.get(name, 0.0) + launch.milliseconds
    return times


class Priced(NamedTuple):
    """One launch on another machine."""

    stage: str
    milliseconds: float
    bound: str


def _priced(found: Prices, place: int) -> list[Priced]:
    """The launches on one of the machines."""
    columns = found.stages, found.milliseconds[place].tolist(), found.bounds[place].tolist()
    return [Priced(*launch) for launch in zip(*columns, strict=True)]


def _changed(
    machine: Machine, numbers: Mapping[str, float], prices: Callable[[Machines], Prices]
) -> dict[str, dict[float, Times]]:
    """Times by number and its value: those near it, of one that does not step, and those 10 % away."""
    changes, machines = [], []
    for key, value in numbers.items():
        near = () if isinstance(value, int) else (value * (1 - NEAR), value * (1 + NEAR))
        for other in (*_ends(key, value), *near):
            with suppress(TilestampError):  # no machine has it
                machines.append(altered(machine, {key: other}))
                changes.append((key, other))
    found, times = prices(machines), dict[str, dict[float, Times]]()
    for place, (key, value) in enumerate(changes):
        if place not in found.refusals:  # the counts depend on it, or a block does not fit
            times.setdefault(key, {})[value] = _by_stage(_priced(found, place))
    return times


def _ends(key: str, value: float) -> tuple[float, float]:
    """What is a noticeable change of a number, down and up."""
    if not isinstance(value, int):
        return value * (1 - FAR), value * (1 + FAR)
    if key.endswith(UNITS):
        return value // 2, value * 2
    step = max(1, round(FAR * value))
    return value - step, value + step


def _rows(key: str, value: float, now: Times, changed: Mapping[float, Times]) -> list[dict[str, Any]]:
    lower, higher = _ends(key, value)
    near = {other: changed.get(other) for other in (value * (1 - NEAR), value * (1 + NEAR))}
    ends = [(other, times) for other, times in near.items() if times is not None]
    ends += [(value, now)] * (len(ends) == 1)  # no machine is beyond it: from one side
    nan = float("nan")
    return [
        {
            "number": key,
            "stage": stage,
            "value": value,
            "elasticity": nan if isinstance(value, int) else _slope(*((other, times[stage]) for other, times in ends)),
            "lower": lower,
            "higher": higher,
            "less": changed[lower][stage] / now[stage] if lower in changed else nan,
            "more": changed[higher][stage] / now[stage] if higher in changed else nan,
        }
        for stage in now
    ]


def _slope(first: tuple[float, float], last: tuple[float, float]) -> float:
    """D log time / d log number."""
    return math.log(last[1] / first[1]) / math.log(last[0] / first[0])


def _freed(
    launches: Sequence[Launch | PipeLaunch],
    machine: Machine,
    now: Sequence[Timing],
    prices: Callable[[Machines], Prices],
) -> dict[str, Sequence[Timing | Priced]]:
    """Price the frame with one thing free, by what that is."""
    terms = [term for term in free_terms(machine) if term not in SCHEDULE_TERMS]
    found = prices([free_of(machine, term) for term in terms])
    freed: dict[str, Sequence[Timing | Priced]] = {term: _priced(found, place) for place, term in enumerate(terms)}
    return freed | {term: without(launches, machine, now, term) for term in SCHEDULE_TERMS}


def _limits(
    free: "pd.DataFrame", now: Sequence[Timing], freed: Mapping[str, Sequence[Timing | Priced]]
) -> "pd.DataFrame":
    """What holds each stage, and what would if that were free."""
    import pandas as pd

    rows = {}
    for stage, times in free.drop(index=FRAME).iterrows():
        holds = str(times.drop("now").idxmin())
        rows[stage] = {
            "milliseconds": times["now"],
            "bound": _bound(now, str(stage)),
            "holds": holds,
            "without": times[holds],
            "next": _bound(freed[holds], str(stage)),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("stage")


def _bound(timings: Sequence[Timing | Priced], stage: str) -> str:
    """What holds the longest launch of a stage."""
    return max((t for t in timings if t.stage == stage), key=lambda timing: timing.milliseconds).bound
