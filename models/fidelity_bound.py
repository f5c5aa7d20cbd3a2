"""How late a schedule can end: a proved upper bound from cheap facts, so that a roofline's error is known unplayed.

``models.bounds`` is never above ``models.schedule``. Here is a number that is never below it; the roofline is at most
``1 - bounds / latest_end`` too low. The proof follows the play of ``models.schedule``, in the manner of Graham's bound
for list scheduling (a makespan is at most the mean load and the longest unit):

*Full.* While units wait for a place, every place is taken. An SM with places P then passes ``alone`` cycles at P a
tick, and its load S, the sum of its residents' rates, slows it by max(1, S). S lies between the sum of the P lowest
and that of the P highest rates of all units; a convex function is nowhere above its chord, so max(1, S) <= i + b S,
and the SM is full for at most (i sum(alone) + b P sum(sm)) / places. Where all units are alike the chord is a point:
then this is the larger of the two terms, as the roofline says, and otherwise it is how terms compete.

*The chip.* The load of its busiest server is treated in the same way; each other server can add what exceeds a load
of one.

*Starting.* Blocks start no faster than their rate. After the last moment at which a place was free but no block was
ready, the machine is full, with what was resident and the blocks still to come: the latest end over all such moments.

*The tail.* Either the places are full until the last unit starts, and then the longest unit runs beside the most that
its SM can hold; or any one unit ends last, and its own start and run count. The lower one holds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.schedule import Loads

Cycles = NDArray[np.float64]


class Latest(NamedTuple):
    """Latest end of a play in cycles, how much of it is after the last unit's start, and whether units ever queue."""

    cycles: float
    tail: float
    waiting: bool


def latest_end(units: Loads) -> Latest:
    """Bound the end of the play of ``models.schedule``.

    Parameters
    ----------
    units : Loads
        What is played.
    """
    sm, chip, alone, places, interval = units
    if not len(alone):
        return Latest(0.0, 0.0, waiting=False)
    taken = places[places > 0]
    resident = int(taken.sum())
    waiting = len(alone) > resident
    least, most = int(taken.min()), int(taken.max())
    together = min(most, -(-len(alone) // len(taken)) + most - least)  # of one SM: starts go where most places are free
    low, high = _sum_lowest(sm / alone, least if waiting else 0), _sum_highest(sm / alone, together)
    pace, share = _chord(low, high)
    step = (pace * alone + share * most * sm) / resident if waiting else np.zeros(len(alone))
    pace, served = _served(sm, chip, alone, taken, together, waiting=waiting)
    start = _starts(step * pace, served, interval, resident)
    longest = float(alone.max())
    crowd = _chord(0.0, high)[1] * _sum_highest(sm, together)
    tail = min(longest * max(1.0, high), longest + crowd)
    end = min(float(start[-1]) + tail, float((start + alone * max(1.0, high)).max()))
    return Latest(end, end - float(start[-1]), waiting)


def _starts(step: Cycles, served: Cycles, interval: float, resident: int) -> Cycles:
    """Latest start of each unit, with all that the chip's servers have left to do then."""
    before = np.cumsum(step) - step
    done = np.cumsum(served) - served
    since = served.sum() - done - before
    if interval:
        left = min(resident, len(step)) - 1  # residents at the last moment at which a place was free
        since[1:] += np.minimum(_sum_highest(step + served, left), before + done)[1:]
        since += interval * np.arange(len(step))
    else:
        since[1:] = -np.inf
    latest: Cycles = before + np.maximum.accumulate(since)
    return latest


def _served(
    sm: Cycles, chip: Cycles, alone: Cycles, taken: NDArray[np.int64], together: int, *, waiting: bool
) -> tuple[float, Cycles]:
    """How the chip stretches time: share of the SMs' own time that stays, and cycles that each unit adds."""
    busiest = int(chip.sum(axis=0).argmax())
    pace, served = 1.0, np.zeros(len(alone))
    for k in range(chip.shape[1]):
        column = chip[:, k]
        if not column.any() or (k != busiest and (column <= chip[:, busiest]).all()):
            continue  # never the fullest
        low, high = _server_load(column, sm, alone, taken, together)
        slack, slope = _chord(low if waiting and k == busiest else 0.0, high)
        served += slope * column
        pace = slack if k == busiest else pace
    return pace, served


def _server_load(
    column: Cycles, sm: Cycles, alone: Cycles, taken: NDArray[np.int64], together: int
) -> tuple[float, float]:
    """Lowest load of a server while every place is taken, and its highest at any time.

    An SM of load S slows the calls of its residents too: by max(1, S), so they are never above column / sm.
    """
    rate = column / alone
    ratio = np.divide(column, sm, out=np.full(len(sm), np.inf), where=sm > 0)
    least, sms = int(taken.min()), len(taken)
    low = sms * min(_sum_lowest(rate, least), float(ratio.min()))
    high = sms * min(_sum_highest(rate, together), float(ratio.max()))
    return low, min(high, _sum_highest(rate, int(taken.sum())))


def _chord(low: float, high: float) -> tuple[float, float]:
    """Intercept and slope of the chord of max(1, x) over [low, high]."""
    if high <= 1.0:
        return 1.0, 0.0
    if low >= 1.0:
        return 0.0, 1.0
    slope = (high - 1.0) / (high - low)
    return 1.0 - slope * low, slope


def _sum_highest(values: Cycles, count: int) -> float:
    """Sum of the ``count`` highest."""
    count = min(count, len(values))
    return float(np.partition(values, len(values) - count)[len(values) - count :].sum()) if count > 0 else 0.0


def _sum_lowest(values: Cycles, count: int) -> float:
    """Sum of the ``count`` lowest."""
    count = min(count, len(values))
    return float(np.partition(values, count - 1)[:count].sum()) if count > 0 else 0.0
