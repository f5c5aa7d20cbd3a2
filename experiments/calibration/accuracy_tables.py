"""Tables of the accuracy page, from the results of the silicon experiments: what was predicted, and how well.

A frame is *seen* where some number of a machine file, mix or experiment says that it was fitted to a cell of it, and
unseen where none does.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from tilestamp.experiments.calibration.residuals import SILICON, by_term, coverage
from tilestamp.experiments.silicon.textured_binned import GAP, STEP
from tilestamp.experiments.silicon.textured_compare import FRAME_TIME, SPAN
from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME
from tilestamp.models.error_model import ALL
from tilestamp.models.fitted import on_frame
from tilestamp.models.machine import list_machines, load_machine

ROOT = Path(__file__).resolve().parents[2]
FITTED_IN = ("models/machines/*.toml", "simulator/mixes/*/*.toml")
FAMILIES = {"silicon-textured_ru": "Ru 2016", "silicon-textured_binned": "Zhang 2025"}  # by experiment
PREFIXES = {"k_": "micropolygons", "freepipe": "FreePipe", "": "CudaRaster"}  # of other kernels
CUDARASTER = ("triangleSetup", "binRaster", "coarseRaster", "fineRaster")
CLEAR = 0.05  # difference in time from which one choice counts as faster
CHECKED = "# Checked against:"
MEASURED = ("measured", "fitted")  # provenance of numbers that a GPU was measured for
FOUND = "found"


class Errors(NamedTuple):
    """How far some values are from those measured: mean and worst absolute error, least and largest ratio."""

    cells: int
    mean: float
    worst: float
    lowest: float
    highest: float


def read_results(results: Path) -> pd.DataFrame:
    """Every compared value of the silicon experiments.

    Returns
    -------
    DataFrame
        The columns of the experiments' tables ``all`` and: ``experiment``; ``family``; ``label``, the kernel's name
        (memsets together, samples apart); ``seen``; ``config``, if only "".
    """
    targets = fitted_targets()
    tables = [_read(path, targets) for path in sorted(results.glob(SILICON))]
    return pd.concat(tables, ignore_index=True)


def fitted_targets() -> list[str]:
    """Cells of silicon experiments that some number was fitted to, as ``FRAME | RESULT | ROW | COLUMN``."""
    texts = [path.read_text("utf-8") for pattern in FITTED_IN for path in sorted(ROOT.glob(pattern))]
    named = re.findall(r'"([^"|]+ \| silicon-[^"]*)"', "\n".join(texts))
    return [*dict.fromkeys(named), *GAP.fitted_to, *STEP.fitted_to]


def _read(path: Path, targets: Sequence[str]) -> pd.DataFrame:
    table = pd.read_csv(path)
    experiment = path.parent.name
    own = [target for target in targets if target.split(" | ")[1] == experiment]
    frames = table.scene + (" " + table.W.astype(str) if "W" in table else "")
    seen = {frame: any(on_frame(target, frame) for target in own) for frame in frames.unique()}
    families = [family(experiment, kernel) for kernel in table.kernel]
    samples = table.spp if "spp" in table else [0] * len(table)
    labels = [label(kernel, spp) for kernel, spp in zip(table.kernel, samples, strict=True)]
    config = table.get("config", "")
    return table.assign(experiment=experiment, family=families, label=labels, seen=frames.map(seen), config=config)


def family(experiment: str, kernel: str) -> str:
    """The system that a kernel is of."""
    return FAMILIES.get(experiment) or next(name for prefix, name in PREFIXES.items() if kernel.startswith(prefix))


def label(kernel: str, spp: int) -> str:
    """A kernel's name in the tables."""
    return ("memset" if kernel.startswith("memset") else kernel) + (f", {spp} spp" if spp else "")


def kernel_times(table: pd.DataFrame) -> pd.DataFrame:
    """Times of kernels and memsets over 5 us."""
    return table[(table.quantity == TIME) & (table.measured > SHORTEST_US)]


def errors(rows: pd.DataFrame) -> Errors:
    """Errors of some rows; nothing of no row."""
    if rows.empty:
        return Errors(0, 0.0, 0.0, 0.0, 0.0)
    error, ratio = rows.error.abs(), rows.ours / rows.measured
    return Errors(len(rows), error.mean(), error.max(), ratio.min(), ratio.max())


def covered(times: pd.DataFrame) -> Iterator[tuple[str, int, float]]:
    """Which times, how many, and the share of them within the intervals that all others give.

    First one experiment after the other, then all times of unseen scenes.
    """
    known = times.dropna(subset="bound")
    parts = {f"`{name}`, from all others": known.experiment == name for name in sorted(known.experiment.unique())}
    for name, left in {**parts, "unseen scenes, from seen ones": ~known.seen}.items():
        factors = by_term(known[~left])
        if left.any() and ALL in factors:
            yield name, int(left.sum()), coverage(known[left], factors)


def by_bound(times: pd.DataFrame, *columns: str) -> list[tuple[tuple[str, ...], Errors, float]]:
    """Errors by the term that holds (and more columns), and the share of all error; the largest share first."""
    known = times.dropna(subset="bound")
    whole, groups = known.error.abs().sum(), known.groupby([*columns, "bound"])
    found = [(name, errors(rows), rows.error.abs().sum() / whole) for name, rows in groups]
    return sorted(found, key=lambda group: -group[2])


def choices(table: pd.DataFrame) -> dict[str, list[tuple[str, str]]]:
    """Of each choice the pairs of what is the fastest, measured and ours, where the measured runner-up is not close."""
    times, frames = table[table.quantity == TIME], table[table.quantity == FRAME_TIME]
    tiles = times[times.kernel == "k_raster"]
    spans = table[(table.quantity == SPAN) & table.config.isin(["stream", "graph"])]
    return {
        "tile size of the micropolygon raster": _fastest(tiles, ["experiment", "scene", "spp"], tiles.tile.astype(int)),
        "CudaRaster or FreePipe": _systems(times[times.family.isin(["CudaRaster", "FreePipe"])]),
        "tile size of Ru 2016's frames": _ways(frames, r"(tiled_t\d+)_(cull|nocull)_(?:original|roomy)"),
        "Ru 2016's tiles or a thread a triangle": _ways(
            frames, r"(tiled|per_primitive)(?:_t\d+)?_(cull|nocull)(?:_original|_roomy)?"
        ),
        "Zhang 2025's stream or graph": _fastest(spans, ["scene"], spans.config),
    }


def _ways(frames: pd.DataFrame, pattern: str) -> list[tuple[str, str]]:
    """The fastest of the ways (first part of the pattern) to draw a scene with one sort of culling (second part)."""
    found = frames.config.str.extract(rf"^{pattern}$").dropna()
    rows = frames.loc[found.index].assign(culling=found[1])
    return _fastest(rows, ["scene", "culling"], found[0])


def _systems(times: pd.DataFrame) -> list[tuple[str, str]]:
    """CudaRaster's four kernels together against FreePipe, where both were measured."""
    chosen = times[times.kernel.isin(CUDARASTER) | (times.family == "FreePipe")]
    whole = chosen.assign(way=[k if k not in CUDARASTER else "CudaRaster" for k in chosen.kernel])
    place = ["experiment", "scene", "W"]
    sums = whole.groupby([*place, "way"], as_index=False)[["ours", "measured"]].sum()
    return _fastest(sums, place, ["CudaRaster" if way == "CudaRaster" else "FreePipe" for way in sums.way])


def _fastest(rows: pd.DataFrame, place: list[str], option: Sequence[object]) -> list[tuple[str, str]]:
    """The option with the least time, measured and ours, at each place where another is slower by 5 % or more."""
    pairs = []
    if rows.empty:
        return []
    for _, group in rows.assign(option=list(option)).groupby(place):
        best = group.groupby("option")[["ours", "measured"]].min()
        first, *others = sorted(best.measured)
        if others and others[0] > (1 + CLEAR) * first:
            pairs.append((str(best.measured.idxmin()), str(best.ours.idxmin())))
    return pairs


def checked_against() -> Mapping[str, tuple[str, str]]:
    """Description of each machine file, and what its header says that it was checked against."""
    described = list_machines()
    return {name: (described[name], _header(ROOT / "models" / "machines" / f"{name}.toml")) for name in described}


def _header(path: Path) -> str:
    """The paragraph of a machine file's comment that says what was checked."""
    _, _, rest = path.read_text("utf-8").partition(CHECKED)
    lines = rest.splitlines()
    end = next((i for i, line in enumerate(lines) if i and line.strip() in {"", "#"}), len(lines))
    return " ".join(line.removeprefix("#").strip() for line in lines[:end])


def on_one_generation() -> dict[str, list[tuple[str, list[str]]]]:
    """Numbers measured, or fitted to what was, on one compute capability only, and published for none.

    Returns
    -------
    dict
        By compute capability: each number, and the machine files that assume it.
    """
    kinds: dict[str, dict[str, set[str]]] = {}
    for name in list_machines():
        machine = load_machine(name)
        for key, (kind, _) in machine.provenance.items():
            kinds.setdefault(key, {}).setdefault(FOUND if kind in MEASURED else kind, set()).add(
                machine.compute_capability if kind in MEASURED else name
            )
    alone = {key: kind for key, kind in kinds.items() if len(kind.get(FOUND, ())) == 1 and "published" not in kind}
    places: dict[str, list[tuple[str, list[str]]]] = {}
    for key in sorted(alone):
        places.setdefault(next(iter(alone[key][FOUND])), []).append((key, sorted(alone[key].get("assumed", ()))))
    return dict(sorted(places.items()))
