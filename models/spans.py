"""Spans: when each unit of a launch starts and ends, and where, as ``models.schedule`` expects it.

What a launch's time has beside its units is said as well, so that all adds up: the kernel's overhead before them, and
after them what the memory and the atomic units of the chip, which serve side by side with the SMs, still take.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import Term
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Launch
from tilestamp.models.launch_prices import Opened
from tilestamp.models.list_schedule import replay, tournament
from tilestamp.models.machine import Machine
from tilestamp.models.price import opened, price
from tilestamp.models.schedule import Loads, crowd
from tilestamp.models.traffic import Traffic

OWN = ("latency", "issue", "shared", "l1", "queue")  # what can hold a unit


@dataclass(frozen=True)
class Spans:
    """The units of one launch in time; arrays (units,), cycles from the launch's beginning.

    Parameters
    ----------
    start, end : ndarray, float64
        From the place that it gets to the moment at which it leaves it.
    place : ndarray, int64
        Which of the places, ``places`` in all; place p is on SM ``p % sms``.
    places, sms : int
    holds : ndarray, int64
        What takes longest of the unit's own costs, an index of ``OWN``.
    units_begin, units_end, total : float
        The overhead of the kernel ends (persistent blocks have started), the last unit ends, the launch ends.
    queue : float
        Cycles that the fullest atomic unit takes for the requests of all units.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    place: NDArray[np.int64]
    places: int
    sms: int
    holds: NDArray[np.int64]
    units_begin: float
    units_end: float
    total: float
    queue: float


def spans(launch: Launch, machine: Machine, moved: Traffic) -> Spans:
    """Starts and ends of the units of a launch.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch.
    """
    whole = opened(launch, machine, moved)
    begin = float(whole.terms[Term.LAUNCH]) + whole.loads.begun
    start, end, place, places = _sooner(whole.loads)
    return Spans(
        start=begin + start,
        end=begin + end,
        place=place,
        places=places,
        sms=whole.loads.sms,
        holds=_holds(whole),
        units_begin=begin,
        units_end=begin + float(end.max(initial=0.0)),
        total=price([launch], machine, "schedule", [moved])[0].cycles,
        queue=float(whole.terms[Term.QUEUE]),
    )


def _sooner(units: Loads) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], int]:
    """Starts, ends, places and their number, as neighbours on the SMs or one an SM: whichever ends sooner."""
    choices = []
    for alone, places in ((crowd(units)[0], units.places), (units.alone, units.sms)):
        out = np.zeros(len(alone)), np.zeros(len(alone)), np.zeros(len(alone), np.int64)
        _record(units.sm, alone, units.draws, units.moves, places, units.sms, units.interval, units.start, *out)
        choices.append((*out, places))
    return min(choices, key=lambda choice: float(choice[1].max(initial=0.0)))


@kernel
def _record(
    sm: Any,
    alone: Any,
    draws: Any,
    moves: Any,
    places: int,
    sms: int,
    interval: float,
    start: float,
    begins: Any,
    ends: Any,
    where: Any,
) -> None:
    """``list_schedule`` that remembers: when each unit got its place, left it, and which it was."""
    units = len(alone)
    free, free_who = tournament(places if units > places else 1)
    served, served_who = tournament(min(sms, units))
    drawn, moved, begun = 0.0, 0.0, -interval
    for i in range(units):
        begun += interval
        where[i] = i
        if i >= places:
            begun = max(begun, free[0])
        if units > places:
            where[i] = free_who[0]
        begins[i] = begin = begun
        done = max(served[0], begun + start) + sm[i]
        replay(served, served_who, done)
        if len(draws) > 0:
            drawn = max(drawn, begun) + draws[i]
            begin = drawn
        if len(moves) > 0:
            moved = max(moved, begun + start) + moves[i]
            done = max(done, moved)
        ends[i] = max(done, begin + alone[i])
        if units > places:
            replay(free, free_who, ends[i])


def _holds(whole: Opened) -> NDArray[np.int64]:
    """What takes longest of each unit's own costs."""
    units, draws = whole.units, whole.loads.draws
    costs = [units.chain, units.issue, units.shared, units.l1, draws if len(draws) else np.zeros(len(units.chain))]
    largest: NDArray[np.int64] = np.argmax(costs, axis=0)
    return largest
