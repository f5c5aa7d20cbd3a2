"""Rows of all units from those that ran: what is foretold of the others, and what units like them missed."""

import numpy as np

from tilestamp.simulator.sampling.estimate import Integers
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
        rows = product(strata.known[rest], fit.factors) + fit.residual[_nearest(sample)]
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


def _nearest(sample: Sample) -> Integers:
    """For each unit of ``left`` the row of the last before it, in launch order, that ran in its stratum."""
    strata, rows = sample.strata, np.cumsum(sample.taken) - sample.taken
    found = []
    for first, end, taken, row in zip(strata.first[:-1], strata.first[1:], sample.taken, rows, strict=True):
        ran, rest = strata.order[first : first + taken], strata.order[first + taken : end]
        ascending = np.argsort(ran)
        found.append(row + ascending[np.searchsorted(ran[ascending], rest).clip(1, taken) - 1] if len(rest) else rest)
    donors: Integers = np.concatenate(found)
    return donors
