"""Strata of units by what is cheaply known of them, and the random part of each that runs.

The largest units are a certainty stratum: they always run, so that the schedule sees the worst imbalance as it is.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.launch import Stream
from tilestamp.simulator.sampling.estimate import Floats, Integers

CERTAIN = 24  # largest units by each thing known, always executed
STEP = 1.3  # largest ratio of sizes in a stratum
FEWEST = 12  # units of a stratum: a smaller one is joined with its neighbour
PILOT = 200  # units that the first sample draws in proportion to size, and ...
PILOT_EACH = 10  # ... at least from each stratum


@dataclass(frozen=True, eq=False)
class Strata:
    """Units by stratum; stratum 0 is the certainty stratum.

    Parameters
    ----------
    known : ndarray, (units, p), float64
        What is known of each unit: 1, its size, and more; each in units of its mean.
    order : ndarray, (units,), int64
        Units, stratum after stratum, in random order inside each: a sample is a prefix of each stratum.
    first : ndarray, (strata + 1,), int64
        Where each stratum starts in ``order``.
    """

    known: Floats
    order: Integers
    first: Integers

    @property
    def units(self) -> Integers:
        """Units of each stratum."""
        return np.diff(self.first)

    @cached_property
    def ordered(self) -> Floats:
        """What is known of the units in ``order``."""
        return self.known[self.order]

    @cached_property
    def sizes(self) -> Floats:
        """Sizes of all units of each stratum together."""
        return np.array([part.sum() for part in np.split(self.ordered[:, 1], self.first[1:-1])])


@dataclass(frozen=True, eq=False)
class Sample:
    """Units that ran, and what they did.

    Parameters
    ----------
    strata : Strata
    taken : ndarray, (strata,), int64
        Units that ran of each stratum.
    rows : ndarray, (sum of taken, events)
        Of the units ``drawn(strata, taken)``.
    exact : dict of int to ndarray, (units,)
        Columns of the rows that are known of all units.
    streams : callable or None
        Buffers touched, had the totals of all rows another (events,) added; None where what is known says which.
    """

    strata: Strata
    taken: Integers
    rows: Integers
    exact: Mapping[int, Integers] = field(default_factory=dict)
    streams: Callable[[Floats], tuple[Stream, ...]] | None = None

    @property
    def sampled(self) -> Integers:
        """Rows without what is known of all units."""
        rows = self.rows.copy()
        rows[:, list(self.exact)] = 0
        return rows

    @property
    def complete(self) -> bool:
        """Whether all units ran."""
        return bool((self.taken == self.strata.units).all())


def make_strata(size: NDArray[np.generic], seed: list[int], *more: NDArray[np.generic]) -> Strata:
    """Cut units into strata by size, and shuffle each.

    Parameters
    ----------
    size : ndarray, (units,)
        Not negative.
    seed : list of int
    *more : ndarray, (units,)
        Further things known, of which some events may be proportional.
    """
    columns = [np.ones(len(size)), *(column.astype(np.float64) for column in (size, *more))]
    known = np.stack([column / (column.mean() or 1.0) for column in columns], axis=1)
    ascending = np.argsort(known[:, 1], kind="stable")
    certain = np.unique(np.argsort(known[:, 1:], axis=0, kind="stable")[-CERTAIN:])
    rest = ascending[~np.isin(ascending, certain)]
    cuts = _cuts(known[rest, 1])
    random = np.random.default_rng(seed)
    parts = [certain, *(random.permutation(part) for part in np.split(rest, cuts) if len(part))]
    first = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    return Strata(known, np.concatenate(parts).astype(np.int64), first.astype(np.int64))


def _cuts(size: Floats) -> Integers:
    """Places where ascending sizes are cut: after the empty ones, then by ratio, no stratum below ``FEWEST``."""
    empty = int(np.searchsorted(size, 0.0, side="right"))
    if empty == len(size):
        return np.zeros(0, np.int64)
    level = np.floor(np.log(size[empty:] / size[empty]) / np.log(STEP) + 1e-9)
    cuts = [empty] if empty else []
    for cut in empty + np.flatnonzero(np.diff(level)) + 1:
        if cut - (cuts[-1] if cuts else 0) >= FEWEST and len(size) - cut >= FEWEST:
            cuts.append(int(cut))
    return np.array(cuts, np.int64)


def pilot(strata: Strata) -> Integers:
    """Units that the first sample takes of each stratum."""
    total = strata.sizes
    share = total / max(total[1:].sum(), 1e-300)
    taken: Integers = np.minimum(strata.units, np.maximum(PILOT_EACH, np.ceil(PILOT * share))).astype(np.int64)
    taken[0] = strata.units[0]
    return taken


def drawn(strata: Strata, taken: Integers) -> Integers:
    """Units of a sample, stratum after stratum."""
    units: Integers = strata.order[places(strata, taken)]
    return units


def places(strata: Strata, taken: Integers) -> Integers:
    """Places in ``order`` of a sample."""
    return np.repeat(strata.first[:-1] - np.cumsum(taken) + taken, taken) + np.arange(taken.sum())
