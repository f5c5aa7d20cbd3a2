"""Rows of all units from those that ran: what is foretold of the others, and what units like them missed."""

from collections.abc import Iterator

import numpy as np

from tilestamp.simulator.sampling.estimate import Floats, Integers
from tilestamp.simulator.sampling.strata import Sample, drawn, places
from tilestamp.simulator.sampling.totals import fit_rows, product, totals


def expanded(sample: Sample) -> Integers:
    """Rows of all units, (units, events): as executed, or what is foretold of them and a miss of those that ran.

    It is the miss of a neighbour in launch order, of the same stratum, so that units are as unlike, and neighbours as
    alike, as those that ran; totals are the estimates.
    """
    strata, taken = sample.strata, sample.taken
    table = np.zeros((len(strata.order), sample.rows.shape[1]), np.int64)
    table[drawn(strata, taken)] = sample.rows
    if not sample.complete:
        values, rest = sample.rows.astype(np.float64), left(sample)
        fit = fit_rows(sample, values)
        rows = product(strata.known[rest], fit.factors) + fit.residual[_donors(sample)]
        np.maximum(rows, 0.0, out=rows)
        sums, goal = rows.sum(axis=0), totals(sample, values).value - values.sum(axis=0)
        rows *= np.where(sums > 0, np.maximum(goal, 0.0) / np.where(sums > 0, sums, 1.0), 0.0)
        ends = np.rint(np.cumsum(rows, axis=0)).astype(np.int64)
        table[rest] = np.diff(ends, axis=0, prepend=0)
    for event, column in sample.exact.items():
        table[:, event] = column
    return table


def left(sample: Sample) -> Integers:
    """Units that did not run, stratum after stratum."""
    ran = np.zeros(len(sample.strata.order), np.bool_)
    ran[places(sample.strata, sample.taken)] = True
    units: Integers = sample.strata.order[~ran]
    return units


def _donors(sample: Sample, random: np.random.Generator | None = None) -> Integers:
    """For each unit of ``left`` the row of one that ran in its stratum: the nearest, or one of a bootstrap sample."""
    taken, rest = sample.taken, sample.strata.units - sample.taken
    first = np.cumsum(taken) - taken
    many, start = np.repeat(taken, rest), np.repeat(first, rest)
    if random is None:
        return _nearest(sample)
    again = np.repeat(first, taken) + (random.random(taken.sum()) * np.repeat(taken, taken)).astype(np.int64)
    donors: Integers = again[start + (random.random(len(many)) * many).astype(np.int64)]
    return donors


def _nearest(sample: Sample) -> Integers:
    """For each unit of ``left`` the row of the last before it in launch order that ran in its stratum, or the first."""
    strata, rows = sample.strata, np.cumsum(sample.taken) - sample.taken
    found = []
    for first, end, taken, row in zip(strata.first[:-1], strata.first[1:], sample.taken, rows, strict=True):
        ran, rest = strata.order[first : first + taken], strata.order[first + taken : end]
        ascending = np.argsort(ran)
        found.append(row + ascending[np.searchsorted(ran[ascending], rest).clip(1, taken) - 1] if len(rest) else rest)
    donors: Integers = np.concatenate(found)
    return donors


def replicas(sample: Sample, values: Floats, count: int) -> Iterator[Floats]:
    """Changes that make the values of the units of ``left`` those of other samples like this one, (units left, k) each.

    A bootstrap within strata, and for each unit left the miss of one unit of it at random: totals then vary as those
    of samples do, and single units as units do.

    Parameters
    ----------
    sample : Sample
    values : ndarray, (units that ran, k), float64
    count : int
    """
    fit, plain = fit_rows(sample, values), _donors(sample)
    few = np.repeat(np.sqrt(sample.taken / np.maximum(sample.taken - 1, 1)), sample.taken)[:, None]
    wide = np.repeat(fit.mean, sample.taken, axis=0) + fit.apart * few
    for replica in range(count):
        yield wide[_donors(sample, np.random.default_rng(replica))] - fit.residual[plain]
