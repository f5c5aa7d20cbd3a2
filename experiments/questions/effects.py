"""What matters: effects of the axes of a study by Morris, or their shares of the variance by Sobol (SALib).

Both look at the logarithm of a number that is above 0 everywhere, so that effects are factors.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.questions.space import Space, extra, values_at
from tilestamp.experiments.studies.study import Study
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd

SEED = 1


def screen(study: Study, number: str = "milliseconds", walks: int = 8) -> "tuple[pd.DataFrame, bool]":
    """Morris: walk through the space, one axis a step.

    Parameters
    ----------
    study : Study
        Its axes are the space.
    number : str
        Of a cell; what else ``record`` may name.
    walks : int
        Each of one cell more than there are axes.

    Returns
    -------
    DataFrame
        A row an axis, the largest effect first: ``axis``; ``effect``, the mean of absolute changes over the whole
        axis, as a factor where the numbers are above 0 (``exp`` of the mean change of the logarithm); ``low`` and
        ``high``, its 95 % interval; ``spread``, the deviation of the changes (of logarithms): large beside the effect
        where it depends on the other axes.
    bool
        Whether effects are factors.
    """
    if walks < 2:
        raise TilestampError(f"{walks} walks: an interval needs two at least")
    try:
        from SALib.analyze import morris as analysis
        from SALib.sample import morris as sampling
    except ImportError:
        raise extra("SALib") from None
    space = Space(study)
    problem = _problem(space)
    shares = sampling.sample(problem, walks, num_levels=4, seed=SEED)
    values, factors = _values(study, space, shares, number)
    found = analysis.analyze(problem, shares, values, num_levels=4, seed=SEED)
    mean, doubt = np.asarray(found["mu_star"], float), np.asarray(found["mu_star_conf"], float)
    ends = {"effect": mean, "low": np.maximum(mean - doubt, 0.0), "high": mean + doubt}
    if factors:
        ends = {name: np.exp(values) for name, values in ends.items()}
    return _ranked(space, {**ends, "spread": np.asarray(found["sigma"], float)}, "effect"), factors


def sobol(study: Study, number: str = "milliseconds", points: int = 64) -> "pd.DataFrame":
    """Sobol: share of the variance of a number that each axis accounts for.

    Parameters
    ----------
    study, number
        As of ``screen``.
    points : int
        A power of two; as many cells as points times axes and two.

    Returns
    -------
    DataFrame
        A row an axis, the largest first: ``axis``; ``alone``, the share of the axis by itself; ``total``, with all
        that it does together with others; ``low`` and ``high``, the 95 % interval of ``total``.
    """
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as sampling
    except ImportError:
        raise extra("SALib") from None
    if points < 2 or points & (points - 1):
        raise TilestampError(f"{points} points: Sobol's sequence needs a power of two")
    space = Space(study)
    problem = _problem(space)
    shares = sampling.sample(problem, points, calc_second_order=False, seed=SEED)
    values, _ = _values(study, space, shares, number)
    if not np.ptp(values):
        raise TilestampError(f"{number} is the same in all {len(values)} cells: there is no variance to share out")
    found = analysis.analyze(problem, values, calc_second_order=False, seed=SEED)
    total, doubt = np.asarray(found["ST"], float), np.asarray(found["ST_conf"], float)
    alone = np.asarray(found["S1"], float)
    return _ranked(space, {"alone": alone, "total": total, "low": total - doubt, "high": total + doubt}, "total")


def _problem(space: Space) -> dict[str, Any]:
    """The unit cube, as SALib wants it."""
    return {"num_vars": len(space.names), "names": space.names, "bounds": [[0.0, 1.0]] * len(space.names)}


def _values(study: Study, space: Space, shares: NDArray[np.float64], number: str) -> tuple[NDArray[np.float64], bool]:
    """Numbers at points of the cube, and whether they are logarithms."""
    found, problems = values_at(study, space.points(shares), [number])
    values = found[:, 0]
    lacking = np.flatnonzero(~np.isfinite(values))
    if len(lacking):
        why = problems[lacking[0]] or f"no {number}"
        raise TilestampError(f"{len(lacking)} of {len(values)} cells have no {number} ({why}): narrow the axes")
    return (np.log(values), True) if (values > 0).all() else (values, False)


def _ranked(space: Space, columns: dict[str, NDArray[np.float64]], by: str) -> "pd.DataFrame":
    import pandas as pd

    table = pd.DataFrame({"axis": space.names, **columns})
    return table.sort_values(by, ascending=False, kind="stable", ignore_index=True)
