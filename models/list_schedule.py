"""List scheduling: units in order, each to the place that is free first; plain numbers in, plain numbers out.

Every time is a sum, a maximum or the soonest of earlier times, so the end is monotone and of the first degree in all
costs together (``models.schedule`` says why that matters). A step costs a replay in each of two tournaments.
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel


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


@kernel
def list_schedule(
    which: Any, sm: Any, alone: Any, draws: Any, moves: Any, places: int, sms: int, pace: Pace, record: Record
) -> tuple[float, float, float]:
    """End of all units; the start of the one that ends last; how long all hold their places; each unit in ``record``.

    Costs have a row a kind of unit; ``which`` is each unit's (``models.kinds``). ``record`` may have no room.

    Units start in order, each ``interval`` or more after the one before it: what could not start while all places were
    taken does not start at once later. Those that waited for a place go on more slowly while memory is busy (``Pace``).
    ``free`` has the times at which places are free, ``served`` those at which SMs have served what came before: where
    there are no more places than SMs, an SM has always served it by then. ``moved`` is the one at which memory has.
    """
    units = len(which)
    waits, shares = units > places, places > sms < units
    drawing, moving, recording = len(draws) > 0, len(moves) > 0, len(record.start) > 0
    free, free_who = tournament(places if waits else 1)
    served, served_who = tournament(sms if shares else 1)
    drawn = moved = end = last_start = held = soonest = idle = 0.0
    interval, start, slower = pace
    begun, busy = -interval, total(moves, which) if moving else 0.0
    for i in range(units):
        kind, late = which[i], i >= places
        begun += interval
        if late:
            begun = max(begun, soonest)
        done = max(idle, begun + start) + sm[kind]
        if shares:
            idle = replay(served, served_who, done)
        begin = begun
        if drawing:
            drawn = max(drawn, begun) + draws[kind]
            begin = drawn
        if moving:
            moved = max(moved, begun + start) + moves[kind]
            done = max(done, moved)
        own = alone[kind]
        if late and slower > 1.0:
            own += min((slower - 1.0) * own, (1.0 - 1.0 / slower) * max(0.0, busy - begin))
        done = max(done, begin + own)
        if recording:
            record.start[i], record.end[i], record.place[i] = begun, done, free_who[0] if waits else i
        held += done - begun
        if done > end:
            end, last_start = done, begun
        if waits:
            soonest = replay(free, free_who, done)
    return end, last_start, held


@kernel
def total(costs: Any, which: Any) -> float:
    """Costs of all units, added up in their order."""
    total = 0.0
    for i in range(len(which)):
        total += costs[which[i]]
    return total


@kernel
def tournament(players: int) -> Any:
    """Times of ``players`` that meet in a tournament: the winner's, which is the soonest, and each game's loser's.

    ``times[0]`` and ``who[0]`` are the winner's; game ``g`` is played by the winners of games ``2 g`` and ``2 g + 1``.
    Times are not below 0, and kept as their bits: as integers these have the same order, and compare sooner.
    """
    leaves = 1
    while leaves < players:
        leaves *= 2
    times = np.zeros(leaves)
    who = np.zeros(leaves, np.uint32)
    for game in range(1, leaves):  # all times are 0: let the left win everywhere, so the right loses
        leaf = 2 * game + 1
        while leaf < leaves:
            leaf *= 2
        who[game] = leaf - leaves
        if leaf - leaves >= players:
            times[game] = np.inf
    return times.view(np.uint64), who


@kernel(lent=True, inline=True)
def replay(times: Any, who: Any, time: float) -> float:
    """Give the winner a later time, play its games again, and return the time of whoever wins now."""
    bits, winner = np.float64(time).view(np.uint64), who[0]
    game = (winner + np.uint32(len(times))) >> np.uint32(1)
    while game > np.uint32(0):
        other, loser = times[game], who[game]
        beaten = other < bits
        times[game] = bits if beaten else other
        who[game] = winner if beaten else loser
        bits = other if beaten else bits
        winner = loser if beaten else winner
        game >>= np.uint32(1)
    times[0] = bits
    who[0] = winner
    return np.uint64(bits).view(np.float64)
