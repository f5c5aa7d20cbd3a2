"""Write ``models/residuals.toml``: how far times were from the model's, by the term that holds.

``python -m tilestamp.experiments.calibration.residuals RESULTS``, where RESULTS is a folder to which ``tilestamp
reproduce`` wrote the silicon experiments and the papers (``-o``).
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME
from tilestamp.models.error_model import ALL, ELSEWHERE, PATH

COVERAGE = 0.95
SILICON = "silicon-*/all.csv"
FRAMES = ("eisenacher2010-*", "laine2011-*", "ru2016-models", "zhang2025-graph")  # published times of whole frames
TIME_UNITS = ("ms", "us", "s")
HEADER = """\
# Written by experiments/calibration/residuals.py: do not edit. A table a machine and term that holds a time: how many
# times, and the factor within which 95 % of them are (models/error_model.py). [elsewhere]: published times of whole
# frames on other machines that no number was fitted to; single kernels and features of papers may be farther off.
"""


def conformal_factor(ratios: Sequence[float]) -> float | None:
    """Factor of 95 % coverage of the next ratio, or nothing where there are too few."""
    distances = sorted(abs(math.log(ratio)) for ratio in ratios)
    place = math.ceil((len(distances) + 1) * COVERAGE)
    return math.exp(distances[place - 1]) if place <= len(distances) else None


def by_term(times: pd.DataFrame) -> dict[str, tuple[int, float]]:
    """Number of times and factor of each term that has enough, and of all; columns bound, ours, measured."""
    groups = {ALL: times, **{str(bound): group for bound, group in times.groupby("bound")}}
    found = {name: (len(group), conformal_factor(list(group.measured / group.ours))) for name, group in groups.items()}
    return {name: (count, factor) for name, (count, factor) in found.items() if factor is not None}


def coverage(times: pd.DataFrame, factors: Mapping[str, tuple[int, float]]) -> float:
    """Share of times within the factors that others gave."""
    allowed = [factors.get(bound, factors[ALL])[1] for bound in times.bound]
    return float((np.abs(np.log(times.measured / times.ours)) <= np.log(allowed)).mean())


def silicon_times(results: Path) -> pd.DataFrame:
    """All kernel times over 5 us of the silicon experiments, with the experiment of each."""
    tables = [pd.read_csv(path).assign(experiment=path.parent.name) for path in sorted(results.glob(SILICON))]
    times = pd.concat([table for table in tables if "bound" in table])
    return times[(times.quantity == TIME) & (times.measured > SHORTEST_US)].reset_index(drop=True)


def published_ratios(results: Path) -> list[float]:
    """Published over ours, of the times of papers that are predicted."""
    paths = [path for pattern in FRAMES for path in sorted(results.glob(f"{pattern}/cells.csv"))]
    cells = pd.concat([pd.read_csv(path) for path in paths])
    cells = cells[(cells.status == "predicted") & cells.unit.isin(TIME_UNITS)].dropna(subset=["published", "ours"])
    return list(cells.published / cells.ours)


def _lines(machine: str, factors: Mapping[str, tuple[int, float]]) -> Iterator[str]:
    for bound, (count, factor) in factors.items():
        yield f"\n[{machine}.{bound}]\ncells = {count}\nfactor = {factor:.3f}\n"


def main(results: Path) -> None:
    """Write the file, and say how many unseen times lie in the intervals that the seen ones give."""
    times = silicon_times(results)
    ratios = published_ratios(results)
    elsewhere = conformal_factor(ratios)
    if elsewhere is None:
        sys.exit(f"{results} holds too few published times")
    tables = {"h200": by_term(times), ELSEWHERE: {ALL: (len(ratios), elsewhere)}}
    PATH.write_text(HEADER + "".join(line for machine in tables for line in _lines(machine, tables[machine])), "utf-8")
    for name, left in times.groupby("experiment"):
        share = coverage(left, by_term(times[times.experiment != name]))
        sys.stdout.write(f"{name}: {100 * share:.1f} % of {len(left)} times lie in the intervals of the others\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
