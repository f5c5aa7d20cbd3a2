"""Spans: when each unit of a launch starts and ends, and where, as ``models.schedule`` expects it.

What a launch's time has beside its units is said as well, so that all adds up: the kernel's overhead before them, and
after them what the memory and the atomic units of the chip, which serve side by side with the SMs, still take.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import Term
from tilestamp.models.launch import Launch
from tilestamp.models.launch_prices import Opened
from tilestamp.models.list_schedule import Record, record_of
from tilestamp.models.machine import Machine
from tilestamp.models.price import opened, price
from tilestamp.models.schedule import Loads, crowd, ends
from tilestamp.models.traffic import Traffic

OWN = ("latency", "issue", "shared", "l1", "queue")  # what can hold a unit


@dataclass(frozen=True, eq=False)
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
    units, places = _sooner(whole.loads)
    return Spans(
        start=begin + units.start,
        end=begin + units.end,
        place=units.place,
        places=places,
        sms=whole.loads.sms,
        holds=_holds(whole),
        units_begin=begin,
        units_end=begin + float(units.end.max(initial=0.0)),
        total=price([launch], machine, "schedule", [moved])[0].cycles,
        queue=float(whole.terms[Term.QUEUE]),
    )


def _sooner(units: Loads) -> tuple[Record, int]:
    """Starts, ends and places, and how many of these, as neighbours on the SMs or one an SM: whichever ends sooner."""
    choices = []
    for alone, places in ((crowd(units)[0], units.places), (units.alone, units.sms)):
        record = record_of(len(alone))
        choices.append((ends(units, alone, places, record)[0], (record, places)))
    return min(choices, key=lambda choice: choice[0])[1]


def _holds(whole: Opened) -> NDArray[np.int64]:
    """What takes longest of each unit's own costs."""
    units, draws = whole.units, whole.loads.draws
    costs = [units.chain, units.issue, units.shared, units.l1, draws if len(draws) else np.zeros(len(units.chain))]
    largest: NDArray[np.int64] = np.argmax(costs, axis=0)
    return largest
