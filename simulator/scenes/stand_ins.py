"""Stand-ins for models that cannot ship: the embedded cage, cut unevenly into patches of the model's sizes.

What a frame costs depends on how many patches there are, how long and how slender each is, and how much of the screen
they cover. Of a model that is not here, four things are kept, all of them statistics: the count of its patches, the
mean and the covariance of the logarithms of its patches' two edges (long, short; weighted by area), and its views. The
cow's 732 patches draw long and short edges from that distribution and are cut to them, in as many parts along u and v
as it takes; one factor for all makes the count right. Its size is **fitted**, one number a model: so that the patches
of Table 2 at 1600x1200 with a bound of 4 come out, as with the model itself.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.scene import Patches

BISECTIONS = 50
PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])  # steps of a two-dimensional low-discrepancy sequence


class Absent(NamedTuple):
    """A model of the papers that is not shipped; its middle is the origin, lengths are in model units.

    Parameters
    ----------
    patches : int
        How many.
    line : str
        What it is.
    scale : float
        Of the embedded cage, where it stands for the model; fitted.
    edges : tuple of float
        Means of the natural logarithms of a patch's longer and its shorter edge; measured.
    spread : tuple of float
        Their variances, and their covariance; measured.
    """

    patches: int
    line: str
    scale: float
    edges: tuple[float, float]
    spread: tuple[float, float, float]


NOT_SHIPPED = {
    "bigguy": Absent(3570, "Bay Raitt's big guy, 3570 patches", 4.231, (-1.311, -1.666), (0.3142, 0.3593, 0.2898)),
    "killeroo": Absent(11532, "headus's killeroo, 11532 patches", 1.949, (-2.708, -3.349), (0.2265, 0.3401, 0.1792)),
}


def cut_like(cage: Patches, model: Absent) -> Patches:
    """Cut a cage into as many patches as a model has, of sizes distributed as the model's.

    Parameters
    ----------
    cage : Patches
        Fewer and larger ones, in model units before ``model.scale``.
    model : Absent
        Whose patches to imitate.
    """
    from tilestamp.simulator.scenes.subpatches import cut, edge_lengths

    wanted = edge_lengths(cage) * model.scale / _drawn_edges(model, len(cage.points))
    low, high = 0.0, float(model.patches)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if _parts(wanted, middle).prod(axis=1).sum() <= model.patches else (low, middle)
    pieces = cut(cage, *_parts(wanted, low).T)
    twice = np.ones(len(pieces.points), dtype=np.int64)
    longest = np.argsort(-edge_lengths(pieces).max(axis=1), kind="stable")
    twice[longest[: model.patches - len(pieces.points)]] = 2
    return cut(pieces, twice)


def _parts(wanted: NDArray[np.float64], factor: float) -> NDArray[np.int64]:
    return np.maximum(1, np.rint(factor * wanted)).astype(np.int64)


def _drawn_edges(model: Absent, count: int) -> NDArray[np.float64]:
    """Edges along u and v from the model's distribution, (count, 2): every other patch has the longer one along v."""
    uniform = (0.5 + np.arange(1, count + 1)[:, None] * PLASTIC) % 1.0
    long, short, both = model.spread
    edges = np.exp(
        np.asarray(model.edges) + np.sqrt(12.0) * (uniform - 0.5) @ np.linalg.cholesky([[long, both], [both, short]]).T
    )
    edges = np.sort(edges, axis=1)
    return np.where(np.arange(count)[:, None] % 2 == 0, edges[:, ::-1], edges)
