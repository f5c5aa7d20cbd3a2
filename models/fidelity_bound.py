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

from typing import Any, NamedTuple

import numpy as np
from numba import njit
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
    sm, alone = units.sm, units.alone
    taken = units.places[units.places > 0]
    resident, least, most = int(taken.sum()), int(taken.min()), int(taken.max())
    waiting = len(alone) > resident
    if not len(alone):
        return Latest(0.0, 0.0, waiting)
    together = min(most, -(-len(alone) // len(taken)) + most - least)  # of one SM: starts go where most places are free
    low, high = _extremes(sm / alone, least, together)
    stretch, served = _served(units, taken, together, waiting=waiting)
    own, shared = _chord(low, high)
    full = (own * alone + shared * most * sm) * (stretch / resident) if waiting else np.zeros(len(alone))
    crowd = _chord(0.0, high)[1] * _sum_highest(sm, together)
    longest = float(alone.max())
    tail = min(longest * max(1.0, high), longest + crowd)
    left = _sum_highest(full + served, min(resident, len(alone)) - 1) if units.interval else 0.0
    start, last = _starts(full, served, alone, units.interval, left, max(1.0, high))
    end = min(start + tail, last)
    return Latest(end, end - start, waiting)


def _served(units: Loads, taken: NDArray[np.int64], together: int, *, waiting: bool) -> tuple[float, Cycles]:
    """How the chip stretches time: share of the SMs' own time that stays, and cycles that each unit adds."""
    calls = np.ascontiguousarray(units.chip.T)
    totals = calls.sum(axis=1)
    busiest = int(totals.argmax())
    stretch, served = 1.0, np.zeros(len(units.alone))
    for k in np.flatnonzero(totals):
        if k != busiest and (calls[k] <= calls[busiest]).all():
            continue  # never the fullest
        low, high = _server_load(calls[k], units, taken, together)
        own, shared = _chord(low if waiting and k == busiest else 0.0, high)
        served += shared * calls[k]
        stretch = own if k == busiest else stretch
    return stretch, served


def _server_load(calls: Cycles, units: Loads, taken: NDArray[np.int64], together: int) -> tuple[float, float]:
    """Lowest load of a server while every place is taken, and its highest at any time.

    An SM of load S slows the calls of its residents too: by max(1, S), so they are never above calls / sm.
    """
    rate = calls / units.alone
    ratio = np.divide(calls, units.sm, out=np.full(len(calls), np.inf), where=units.sm > 0)
    low, high = _extremes(rate, int(taken.min()), together)
    sms = len(taken)
    high = sms * min(high, float(ratio.max()))
    return sms * min(low, float(ratio.min())), min(high, _sum_highest(rate, int(taken.sum()))) if high > 1.0 else high


def _chord(low: float, high: float) -> tuple[float, float]:
    """Intercept and slope of the chord of max(1, x) over [low, high]."""
    if high <= 1.0:
        return 1.0, 0.0
    if low >= 1.0:
        return 0.0, 1.0
    slope = (high - 1.0) / (high - low)
    return 1.0 - slope * low, slope


def _extremes(values: Cycles, few: int, many: int) -> tuple[float, float]:
    """Sum of the ``few`` lowest, and of the ``many`` highest."""
    return -_sum_highest(-values, few), _sum_highest(values, many)


@njit(cache=True, nogil=True)
def _starts(full: Any, served: Any, alone: Any, interval: float, left: float, crowded: float) -> tuple[float, float]:
    """Latest start of the last unit, and latest end of any, with all that the chip's servers have left to do then.

    ``since`` belongs to the last moment at which a place was free but unit i was not ready; residents had ``left`` to
    do.
    """
    before = 0.0  # that the units before this one keep the machine full
    done = 0.0  # that they ask of the chip's servers
    everything = 0.0
    for i in range(len(served)):
        everything += served[i]
    since = everything
    start = 0.0
    end = 0.0
    for i in range(len(full)):
        if interval > 0.0 and i > 0:
            since = max(since, i * interval + min(left, before + done) + everything - done - before)
        start = before + since
        end = max(end, start + alone[i] * crowded)
        before += full[i]
        done += served[i]
    return start, end


@njit(cache=True, nogil=True)
def _sum_highest(values: Any, count: int) -> float:
    """Sum of the ``count`` highest, by a heap of them whose lowest is on top."""
    count = min(count, len(values))
    heap = np.full(max(1, count), -np.inf)
    for i in range(len(values) if count > 0 else 0):
        value = values[i]
        if value <= heap[0]:
            continue
        hole = 0
        while 2 * hole + 1 < count:
            child = 2 * hole + 1
            if child + 1 < count and heap[child + 1] < heap[child]:
                child += 1
            if heap[child] >= value:
                break
            heap[hole] = heap[child]
            hole = child
        heap[hole] = value
    total = 0.0
    for place in range(count):
        total += heap[place]
    return total
