"""Sampling: totals of a population of units of work from a stratified random part of it, with their intervals.

Before a stage runs, something cheap is known about each of its units: the length of a tile's list, the visible
triangles of a block. Units are cut into strata of nearly equal size by it. The largest units are a certainty stratum:
they always run, so that the schedule sees the worst imbalance as it is. In every other stratum a random part runs. What
those units did is predicted by what was known of them, by least squares; a total is the prediction for all units and,
stratum by stratum, the mean of what it misses (the regression estimator: Cochran 1977, Sampling Techniques, chapters
5 to 7), with the finite-population correction: when all have run, the interval has no width.

Everything here is a pure function of sizes, rows and a seed.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.sampling.estimate import Floats, Integers, Totals, t_quantile
from tilestamp.simulator.sampling.strata import Sample, places

ENOUGH = 16  # units that ran for each thing known, before rows are predicted by them
FEWEST_KNOWN = 2  # things: 1, and the size
PRIOR = 1.0  # degrees of freedom that the spread usual in other strata counts for
GENEROUS = 1.15  # of the units that the error seems to ask for: a spread is itself an estimate
MOST_PULL = 0.9  # of one unit on its own prediction, as the spread takes it
RARE = 0.25  # of what it does, by which one unit that was not seen may deviate (assumed), where ...
ALIKE = 0.01  # (relative) nearly all units do what is foretold, which is ...
MOSTLY = 0.9  # of them


@dataclass(frozen=True)
class Fit:
    """What rows are predicted to be, and how far they are from it."""

    factors: Floats  # (p, k): rows are predicted as what is known times these
    residual: Floats  # (units that ran, k) less the prediction
    apart: Floats  # (units that ran, k) from the stratum's mean residual, had the unit not been in the fit (jackknife)
    mean: Floats  # (strata, k) of the residuals
    spread: Floats  # (strata, k) their variance
    weight: Floats  # (strata,) variance of a total by unit variance: N^2 (1 - n / N) / n
    taken: Integers


def fit_rows(sample: Sample, values: Floats) -> Fit:
    """Fit what is known to the values of the units that ran, (units, k); stratum by stratum what that misses."""
    strata, taken = sample.strata, sample.taken
    known = strata.ordered[places(strata, taken)]
    factors, leverage = _factors(sample, known, values)
    residual = values - product(known, factors)
    starts = np.concatenate([[0], np.cumsum(taken)[:-1]])
    some = np.maximum(taken, 1)[:, None]
    mean = _reduce(residual, starts, taken) / some
    apart = (residual - np.repeat(mean, taken, axis=0)) / (1 - leverage)[:, None]
    spread = _reduce(apart**2, starts, taken) / np.maximum(taken - 1, 1)[:, None]
    weight = strata.units * (strata.units - taken) / some[:, 0]
    return Fit(factors, residual, apart, mean, spread, weight, taken)


def _factors(sample: Sample, known: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Least squares of rows on what is known, but for the certainty stratum; and how much each row pulls its fit."""
    taken, first = sample.taken, int(sample.taken[0])
    factors, leverage = np.zeros((known.shape[1], values.shape[1])), np.zeros(len(values))
    used = (len(values) - first) // ENOUGH
    if used < FEWEST_KNOWN:
        return factors, leverage
    weight = np.repeat(sample.strata.units[1:] / np.maximum(taken[1:], 1), taken[1:]) / (known[first:, 1] + 0.1)
    some = known[first:, :used]
    weighted = (some * weight[:, None]).T
    inverse = np.linalg.pinv(product(weighted, some), hermitian=True)
    factors[: some.shape[1]] = product(inverse, product(weighted, values[first:]))
    leverage[first:] = np.minimum((product(some, inverse) * weighted.T).sum(axis=1), MOST_PULL)
    return factors, leverage


def product(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> Floats:
    """Multiply matrices on this thread: those of a linear algebra library spin long after such small products."""
    if a.shape[0] < a.shape[1]:  # few rows
        return np.stack([(row[:, None] * b).sum(axis=0) for row in a])
    made: Floats = a[:, :1] * b[0]
    for column in range(1, a.shape[1]):
        made += a[:, column, None] * b[column]
    return made


def _reduce(values: Floats, starts: Integers, taken: Integers) -> Floats:
    """Sums by stratum; 0 for one of which none was taken."""
    sums = np.zeros((len(taken), *values.shape[1:]))
    some = taken > 0
    if some.any():
        sums[some] = np.add.reduceat(values, starts[some], axis=0)
    return sums


def totals(sample: Sample, values: Floats) -> Totals:
    """Estimate the population's totals.

    Parameters
    ----------
    sample : Sample
    values : ndarray, (units that ran, k), float64
        Of each unit that ran, in the order of ``sample.rows``.
    """
    if sample.complete:
        none = np.zeros(values.shape[1])
        return Totals(values.sum(axis=0), none, none + np.inf)
    fit = fit_rows(sample, values)
    units, first = sample.strata.units, int(sample.taken[0])
    rest = sample.strata.ordered[first:].sum(axis=0) @ fit.factors + (units[1:, None] * fit.mean[1:]).sum(axis=0)
    value = values[:first].sum(axis=0) + rest
    part = fit.weight[:, None] * _smoothed(sample, fit)
    variance = part.sum(axis=0)
    below = (part**2 / np.maximum(fit.taken - 1 + PRIOR, 1)[:, None]).sum(axis=0)
    freedom = np.where(below > 0, variance**2 / np.where(below > 0, below, 1.0), np.inf)
    unseen, few = _rare(sample, values, fit)
    return Totals(value, variance + unseen, np.minimum(freedom, few))


def _rare(sample: Sample, values: Floats, fit: Fit) -> tuple[Floats, Floats]:
    """Account for deviations that few units have: variance by those not seen, and degrees of freedom by those seen.

    Where nearly all units that ran are alike, one more is taken to deviate by ``RARE`` of what it does. Where few units
    make up the spread, it is as sure as that of few: the variance of a variance by the fourth moment.
    """
    taken = sample.taken
    partly = np.repeat(taken < sample.strata.units, taken)[:, None]
    share = np.repeat(sample.strata.units / np.maximum(taken, 1), taken)[:, None] * partly
    square = (share * fit.apart) ** 2
    second, fourth = square.sum(axis=0), (square**2).sum(axis=0)
    carriers = second**2 / np.where(fourth > 0, fourth, 1.0)  # units that make up the spread; a third if normal
    n = max(int(partly.sum()), 1)
    few = np.where(fourth > 0, 2 / np.maximum(1 / np.maximum(carriers, 1.0) - 1 / n, 1e-9), np.inf)
    does = share * np.abs(values)
    alike = np.abs(share * fit.residual) <= ALIKE * does
    units = (does > 0).sum(axis=0)
    rare = (alike & (does > 0)).sum(axis=0) >= MOSTLY * units
    unseen = np.where(rare, (RARE**2 * does**2).sum(axis=0) / np.maximum(units, 1), 0.0)
    return unseen, few


def enlarged(sample: Sample, values: Floats, error: float) -> Integers:
    """Units of each stratum that a relative error asks for, as the sample so far makes believe; all if none fewer do.

    Every column of ``values`` is asked to reach the error. Units are spread by Neyman's rule: where there are many, and
    where they differ.
    """
    fit, found = fit_rows(sample, values), totals(sample, values)
    N, n = sample.strata.units, sample.taken
    relative = np.where(found.value != 0, 1 / np.where(found.value != 0, found.value, 1.0), 0.0)
    unlike = np.sqrt(_smoothed(sample, fit) * relative**2)  # by stratum and quantity
    wish = N * unlike.max(axis=1)
    wish[wish < 1e-9 * wish.max(initial=0.0)] = 0.0  # rounding of units that are alike
    goal = (error / t_quantile(found.freedom)) ** 2
    low, high = 0.0, float((N[wish > 0] / wish[wish > 0]).max(initial=0.0))
    for _ in range(60):  # the smallest sample by bisection of its scale
        middle = (low + high) / 2
        m = np.clip(np.ceil(middle * wish), n, N)
        enough = ((N * (N - m) / np.maximum(m, 1))[:, None] * unlike**2).sum(axis=0) <= goal
        low, high = (low, middle) if enough.all() else (middle, high)
    more = np.clip(np.ceil(GENEROUS * high * wish), n, N)
    return np.where(more > 0.8 * N, N, more).astype(np.int64)


def _smoothed(sample: Sample, fit: Fit) -> Floats:
    """Residual variances, small samples' drawn towards what is usual: in proportion to size, or not, if less."""
    strata = sample.strata
    size = strata.sizes
    square = ((size / np.maximum(strata.units, 1) + 0.1) ** 2)[:, None]
    freedom = np.where(sample.taken < strata.units, np.maximum(sample.taken - 1, 0), 0)[:, None]
    share = freedom / max(freedom.sum(), 1)
    usual = np.minimum((share * fit.spread / square).sum(axis=0) * square, (share * fit.spread).sum(axis=0))
    prior = np.where(size > 0, PRIOR, 0.0)[:, None]  # units without size are alike
    smoothed: Floats = (freedom * fit.spread + prior * usual) / np.maximum(freedom + prior, 1)
    return smoothed
