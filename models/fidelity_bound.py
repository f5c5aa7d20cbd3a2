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

from tilestamp.models.kernel import kernel
from tilestamp.models.schedule import Loads


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
    if not len(units.alone):
        return Latest(0.0, 0.0, waiting=False)
    return Latest(*_latest_end(*units[:3], units.places[units.places > 0], units.interval))


@kernel
def _latest_end(sm: Any, chip: Any, alone: Any, taken: Any, interval: float) -> tuple[float, float, bool]:
    """Cycles, tail and whether units wait, of the SMs that hold any."""
    units = len(alone)
    resident, least, most = taken.sum(), taken.min(), taken.max()
    waiting = units > resident
    together = min(most, -(-units // len(taken)) + most - least)  # of one SM: starts go where most places are free
    rate = sm / alone
    high = _sum_highest(rate, together, 1.0)
    own, shared = _chord(-_sum_highest(rate, least, -1.0), high)
    served = np.zeros(units)  # cycles for which each unit keeps the chip's servers
    stretch = _serve(served, sm, chip, alone, taken, together, waiting)
    full = np.zeros(units)  # cycles for which each unit keeps the machine full
    longest = 0.0
    for i in range(units):
        longest = max(longest, alone[i])
        if waiting:
            full[i] = (own * alone[i] + shared * most * sm[i]) * (stretch / resident)
    crowd = _chord(0.0, high)[1] * _sum_highest(sm, together, 1.0)
    tail = min(longest * max(1.0, high), longest + crowd)
    left = _sum_highest(full + served, min(resident, units) - 1, 1.0) if interval > 0.0 else 0.0
    start, last = _starts(full, served, alone, interval, left, max(1.0, high))
    end = min(start + tail, last)
    return end, end - start, waiting


@kernel
def _serve(served: Any, sm: Any, chip: Any, alone: Any, taken: Any, together: int, waiting: bool) -> float:
    """Add the cycles that each unit keeps the chip's servers; return the share of the SMs' own time that stays."""
    servers = chip.shape[1]
    totals = np.zeros(servers)
    for i in range(len(alone)):
        for k in range(servers):
            totals[k] += chip[i, k]
    busiest = int(np.argmax(totals))
    stretch = 1.0
    for k in range(servers):
        if totals[k] == 0.0 or (k != busiest and _never_fuller(chip, k, busiest)):
            continue
        low, high = _server_load(chip, k, sm, alone, taken, together)
        own, shared = _chord(low if waiting and k == busiest else 0.0, high)
        if k == busiest:
            stretch = own
        for i in range(len(alone)):
            served[i] += shared * chip[i, k]
    return stretch


@kernel
def _never_fuller(chip: Any, k: int, busiest: int) -> bool:
    """Tell whether every unit asks more of the busiest server than of server k."""
    for i in range(len(chip)):  # noqa: SIM110 - plain loops compile to plain code
        if chip[i, k] > chip[i, busiest]:
            return False
    return True


@kernel
def _server_load(chip: Any, k: int, sm: Any, alone: Any, taken: Any, together: int) -> tuple[float, float]:
    """Lowest load of a server while every place is taken, and its highest at any time.

    An SM of load S slows the calls of its residents too: by max(1, S), so they are never above their share of sm.
    """
    rate = np.empty(len(alone))
    fewest, most = np.inf, 0.0
    for i in range(len(alone)):
        rate[i] = chip[i, k] / alone[i]
        ratio = chip[i, k] / sm[i] if sm[i] > 0.0 else np.inf
        fewest = min(fewest, ratio)
        most = max(most, ratio)
    sms = len(taken)
    low = sms * min(-_sum_highest(rate, taken.min(), -1.0), fewest)
    high = sms * min(_sum_highest(rate, together, 1.0), most)
    if high > 1.0:
        high = min(high, _sum_highest(rate, taken.sum(), 1.0))
    return low, high


@kernel
def _chord(low: float, high: float) -> tuple[float, float]:
    """Intercept and slope of the chord of max(1, x) over [low, high]."""
    if high <= 1.0:
        return 1.0, 0.0
    if low >= 1.0:
        return 0.0, 1.0
    slope = (high - 1.0) / (high - low)
    return 1.0 - slope * low, slope


@kernel
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


@kernel
def _sum_highest(values: Any, count: int, sign: float) -> float:
    """Sum of the ``count`` highest, times their sign, by a heap of them whose lowest is on top."""
    count = min(count, len(values))
    heap = np.full(max(1, count), -np.inf)
    for i in range(len(values) if count > 0 else 0):
        value = sign * values[i]
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
