"""Places: which of many is free first, where each is taken as it becomes free.

As long as units end in the order in which they began, they take places in turn. From the first one on that does not,
the places play a tournament, and each unit costs a replay of one player's games.
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel


class Times(NamedTuple):
    """When each of some places is free.

    Parameters
    ----------
    bits : ndarray, (leaves,), uint64
        Not below 0, and kept as their bits: as integers these have the same order, and compare sooner.
    losers : ndarray, (leaves,), uint32
        Of each game of a tournament that the sooner one wins: game ``g`` is between the winners of games ``2 g`` and
        ``2 g + 1``, the last ones between neighbours.
    count : uint64
        Places; the leaves behind them are never free.
    """

    bits: Any
    losers: Any
    count: Any


class Next(NamedTuple):
    """The place that is free first.

    Parameters
    ----------
    time : float
    place : uint64
    newest : float
        The last time that was put in, while all came in order, so that places take turns; then infinite: they play.
    """

    time: float
    place: Any
    newest: float


@kernel
def times_of(places: int) -> Times:
    """All places free."""
    leaves = 1
    while leaves < places:
        leaves *= 2
    times = np.zeros(leaves)
    times[places:] = np.inf
    return Times(times.view(np.uint64), np.empty(leaves, np.uint32), np.uint64(places))


@kernel(lent=True, inline=True)
def put(times: Times, free: Next, time: float) -> Any:
    """Take the place that is free first, until ``time``; return the ``Next`` one."""
    bits = np.float64(time).view(np.uint64)
    times.bits[free.place] = bits
    if time >= free.newest:
        place = free.place + np.uint64(1)
        place = place if place < times.count else np.uint64(0)
        return Next(_time(times.bits[place]), place, time)
    if free.newest < np.inf:
        place = tournament(times.bits, times.losers)
        return Next(_time(times.bits[place]), place, np.inf)
    return replay(times.bits, times.losers, free.place, bits)


@kernel(lent=True, inline=True)
def _time(bits: Any) -> float:
    return np.uint64(bits).view(np.float64)


@kernel(lent=True)
def tournament(bits: Any, losers: Any) -> Any:
    """Play all games, and return who wins: first from below, with winners in place of losers, then from above."""
    for game in range(len(losers) - 1, 0, -1):
        left, right = _player(losers, 2 * game), _player(losers, 2 * game + 1)
        losers[game] = right if bits[right] < bits[left] else left
    winner = _player(losers, 1)
    for game in range(1, len(losers)):
        losers[game] = _player(losers, 2 * game) + _player(losers, 2 * game + 1) - np.uint64(losers[game])
    return winner


@kernel(lent=True, inline=True)
def _player(winners: Any, game: int) -> Any:
    """Who comes from a game, or from the leaf that stands in its place."""
    return np.uint64(winners[game] if game < len(winners) else game - len(winners))


@kernel(lent=True, inline=True)
def replay(times: Any, losers: Any, winner: Any, bits: Any) -> Any:
    """Play the games of the winner, whose time is another, again."""
    game = (winner + np.uint64(len(losers))) >> np.uint64(1)
    while game > np.uint64(0):
        loser = np.uint64(losers[game])
        other = times[loser]
        beaten = other < bits
        losers[game] = winner if beaten else loser
        bits = other if beaten else bits
        winner = loser if beaten else winner
        game >>= np.uint64(1)
    return Next(_time(bits), winner, np.inf)
