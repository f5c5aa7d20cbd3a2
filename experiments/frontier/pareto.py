"""The Pareto front: what nothing else beats in cost and error at once."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def pareto_front(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Tell which points no other point dominates.

    A point dominates another when it is no worse in both and better in one; of equal points all stay.

    Parameters
    ----------
    cost, error : array_like, (points,)
        Lower is better. A point that has a NaN is never on the front.

    Returns
    -------
    ndarray, (points,), bool
    """
    pairs = np.stack((np.asarray(cost, np.float64), np.asarray(error, np.float64)), axis=1)
    known = np.flatnonzero(np.isfinite(pairs).all(axis=1))
    one, other = pairs[known][:, None], pairs[known][None]
    dominates = (one <= other).all(axis=2) & (one < other).any(axis=2)
    front = np.zeros(len(pairs), np.bool_)
    front[known[~dominates.any(axis=0)]] = True
    return front
