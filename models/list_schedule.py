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
    sm: Any, alone: Any, draws: Any, moves: Any, places: int, sms: int, pace: Pace, record: Record
) -> tuple[float, float, float]:
    """End of all units; the start of the one that ends last; how long all hold their places; each unit in ``record``.

    ``record`` may have no room.

    Units start in order, each ``interval`` or more after the one before it: what could not start while all places were
    taken does not start at once later. Those that waited for a place go on more slowly while memory is busy (``Pace``).
    ``free`` has the times at which places are free, ``served`` those at which SMs have served what came before: where
    there are no more places than SMs, an SM has always served it by then. ``moved`` is the one at which memory has.
    """
    units = len(alone)
    waits, shares = units > places, places > sms < units
    free, free_who = tournament(places if waits else 1)
    served, served_who = tournament(sms if shares else 1)
    drawn = moved = end = last_start = held = 0.0
    interval, start, slower = pace
    begun, busy = -interval, moves.sum() if len(moves) > 0 else 0.0
    for i in range(units):
        begun += interval
        if i >= places:
            begun = max(begun, free[0])
        done = max(served[0], begun + start) + sm[i]
        if shares:
            replay(served, served_who, done)
        begin = begun
        if len(draws) > 0:
            drawn = max(drawn, begun) + draws[i]
            begin = drawn
        if len(moves) > 0:
            moved = max(moved, begun + start) + moves[i]
            done = max(done, moved)
        own = alone[i]
        if i >= places:
            own += min((slower - 1.0) * own, (1.0 - 1.0 / slower) * max(0.0, busy - begin))
        done = max(done, begin + own)
        if len(record.start) > 0:
            record.start[i], record.end[i], record.place[i] = begun, done, free_who[0] if waits else i
        held += done - begun
        if done > end:
            end, last_start = done, begun
        if waits:
            replay(free, free_who, done)
    return end, last_start, held


@kernel
def tournament(players: int) -> Any:
    """Times of ``players`` that meet in a tournament: the winner's, which is the soonest, and each game's loser's.

    ``times[0]`` and ``who[0]`` are the winner's; game ``g`` is played by the winners of games ``2 g`` and ``2 g + 1``.
    """
    leaves = 1
    while leaves < players:
        leaves *= 2
    times = np.zeros(leaves)
    who = np.zeros(leaves, np.int64)
    for game in range(1, leaves):  # all times are 0: let the left win everywhere, so the right loses
        leaf = 2 * game + 1
        while leaf < leaves:
            leaf *= 2
        who[game] = leaf - leaves
        if leaf - leaves >= players:
            times[game] = np.inf
    return times, who


@kernel
def replay(times: Any, who: Any, time: float) -> None:
    """Give the winner a later time, and play its games again."""
    winner = who[0]
    game = (winner + len(times)) >> 1
    while game > 0:
        other, loser = times[game], who[game]
        beaten = other < time
        times[game] = time if beaten else other
        who[game] = winner if beaten else loser
        time = other if beaten else time
        winner = loser if beaten else winner
        game >>= 1
    times[0] = time
    who[0] = winner
