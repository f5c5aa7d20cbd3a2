"""List scheduling: units in order, each to the place that is free first; plain numbers in, plain numbers out.

Every time is a sum, a maximum or the soonest of earlier times, so the end is monotone and of the first degree in all
costs together (``models.schedule`` says why that matters). A step costs taking a place and an SM (``models.places``).
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.models.places import Next, Times, put, times_of


class Record(NamedTuple):
    """Where the schedule is written down: arrays (units,), or all of length 0.

    Parameters
    ----------
    start, end : ndarray, float64
        When each unit got its place, and left it.
    place : ndarray, int64
        Which one it was.
    """

    start: Any
    end: Any
    place: Any


class Pace(NamedTuple):
    """How fast units follow each other, and go.

    Parameters
    ----------
    interval : float
        From one start to the next, at least.
    start : float
        From a free place to the first instruction of the unit put there.
    slower : float
        Times that a unit's own time is longer while memory is busy, if it waited for its place; 1: it is not.
    """

    interval: float
    start: float
    slower: float


@kernel
def record_of(units: int) -> Record:
    """Room for so many units."""
    return Record(np.empty(units), np.empty(units), np.empty(units, np.int64))


class Room(NamedTuple):
    """Where units go.

    Parameters
    ----------
    places : int
    waits, shares : bool
        Whether units wait for a place, and whether they share SMs: else nobody needs to know who is free first.
    free : Times
        When places are free.
    served : Times
        When SMs have served what came before: with no more places than SMs, they always have.
    """

    places: int
    waits: bool
    shares: bool
    free: Times
    served: Times


class Now(NamedTuple):
    """Where a schedule stands after a unit.

    Parameters
    ----------
    begun, done : float
        When it got its place, and leaves it.
    drawn, moved : float
        When the fullest atomic unit, and memory, have served what came before.
    free, idle : Next
        The next place, and the SM that has served what came before.
    end, last, held : float
        End of all; the start of the one that ends last; how long all hold their places.
    """

    begun: float
    done: float
    drawn: float
    moved: float
    free: Next
    idle: Next
    end: float
    last: float
    held: float


@kernel
def list_schedule(
    which: Any, sm: Any, alone: Any, draws: Any, moves: Any, places: int, sms: int, pace: Pace, record: Record
) -> tuple[float, float, float]:
    """End of all units; the start of the one that ends last; how long all hold their places; each unit in ``record``.

    Costs have a row a kind of unit; ``which`` is each unit's (``models.kinds``). ``record`` may have no room.

    Units start in order, each ``interval`` or more after the one before it: what could not start while all places were
    taken does not start at once later. Those that waited for a place go on more slowly while memory is busy (``Pace``).
    """
    room, now, recording = room_of(places, sms, len(which)), nothing_done(pace), len(record.start) > 0
    busy = busy_of(moves, which, pace)
    for i in range(len(which)):
        kind, place = which[i], np.int64(now.free.place) if room.waits else i
        now = step(i, sm[kind], alone[kind], *served_of(draws, moves, kind), pace, busy, room, now)
        if recording:
            record.start[i], record.end[i], record.place[i] = now.begun, now.done, place
    return now.end, now.last, now.held


@kernel
def list_schedules(
    which: Any, sm: Any, crowded: Any, alone: Any, draws: Any, moves: Any, places: int, sms: int, pace: Pace
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Two of them: with neighbours, and one unit an SM; side by side, as each by itself waits for what it just did."""
    many, one = room_of(places, sms, len(which)), room_of(sms, sms, len(which))
    now, lonely, busy = nothing_done(pace), nothing_done(pace), busy_of(moves, which, pace)
    for i in range(len(which)):
        kind = which[i]
        served = served_of(draws, moves, kind)
        now = step(i, sm[kind], crowded[kind], *served, pace, busy, many, now)
        lonely = step(i, sm[kind], alone[kind], *served, pace, busy, one, lonely)
    return (now.end, now.last, now.held), (lonely.end, lonely.last, lonely.held)


@kernel(lent=True, inline=True)
def step(i: int, sm: float, own: float, draw: float, move: float, pace: Pace, busy: float, room: Room, now: Now) -> Now:
    """Put unit ``i`` to the place that is free first; ``busy``: when memory has served all."""
    begun, _, drawn, moved, free, idle, end, last, held = now
    begun, late = begun + pace.interval, i >= room.places
    if late:
        begun = max(begun, free.time)
    done = max(idle.time, begun + pace.start) + sm
    if room.shares:
        idle = put(room.served, idle, done)
    begin = begun
    if draw >= 0.0:
        drawn = max(drawn, begun) + draw
        begin = drawn
    moved = max(moved, begun + pace.start) + move
    if late and pace.slower > 1.0:
        own += min((pace.slower - 1.0) * own, (1.0 - 1.0 / pace.slower) * max(0.0, busy - begin))
    done = max(max(done, moved), begin + own)
    if done > end:
        end, last = done, begun
    if room.waits:
        free = put(room.free, free, done)
    return Now(begun, done, drawn, moved, free, idle, end, last, held + (done - begun))


@kernel(lent=True, inline=True)
def served_of(draws: Any, moves: Any, kind: Any) -> tuple[float, float]:
    """What the fullest atomic unit (below 0: units are not drawn) and memory serve of a unit."""
    return draws[kind] if len(draws) > 0 else -1.0, moves[kind] if len(moves) > 0 else 0.0


@kernel(lent=True)
def busy_of(moves: Any, which: Any, pace: Pace) -> float:
    """When memory has served all units, where that matters."""
    return total(moves, which) if pace.slower > 1.0 and len(moves) > 0 else 0.0


@kernel(lent=True)
def nothing_done(pace: Pace) -> Now:
    """Before the first unit."""
    first = Next(0.0, np.uint64(0), 0.0)
    return Now(-pace.interval, 0.0, 0.0, 0.0, first, first, 0.0, 0.0, 0.0)


@kernel
def room_of(places: int, sms: int, units: int) -> Room:
    """All places free, and all SMs idle."""
    waits, shares = units > places, places > sms < units
    return Room(places, waits, shares, times_of(places if waits else 1), times_of(sms if shares else 1))


@kernel(lent=True)
def total(costs: Any, which: Any) -> float:
    """Costs of all units, added up in their order."""
    total = 0.0
    for i in range(len(which)):
        total += costs[which[i]]
    return total
