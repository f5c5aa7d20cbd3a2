"""Write docs/accuracy.md and its plot: every predicted value of the silicon experiments beside the measured one.

``python -m tilestamp.experiments.calibration.accuracy RESULTS``, in a checkout, where RESULTS is a folder to which
``tilestamp reproduce`` wrote the silicon experiments (``-o``).
"""

import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pandas as pd

from tilestamp.experiments.calibration.accuracy_tables import (
    ROOT,
    Errors,
    by_bound,
    checked_against,
    choices,
    covered,
    errors,
    kernel_times,
    on_one_generation,
    read_results,
)
from tilestamp.experiments.calibration.residuals import COVERAGE, SILICON
from tilestamp.experiments.silicon.textured_compare import FRAME_TIME, SPAN
from tilestamp.reports.accuracy_plot import accuracy_plot

MARKER = "<!-- Written by experiments/calibration/accuracy.py from results: do not edit. -->"
PLOT = Path("reports/gallery/accuracy.png")
LEFT_OUT = "silicon-leave_one_out/cells.csv"
TIME_AIM, KERNEL_AIM, COUNT_AIM = (0.06, 0.25), 0.12, 0.0  # mean and worst of all times; mean of a kernel; exact
AIMS = {  # of other quantities, and whether in percent
    "blocks": (COUNT_AIM, True),
    "warps": (COUNT_AIM, True),
    "atomic instructions": (COUNT_AIM, True),
    "instructions": (0.03, True),
    "SIMD efficiency": (0.03, False),
    "load sectors": (0.05, True),
    "store sectors": (0.05, True),
    "atomic sectors": (0.05, True),
    "L2 traffic": (0.15, True),
    "DRAM traffic": (0.15, True),
    FRAME_TIME: (0.08, True),
    SPAN: (0.08, True),
}
BY_KERNEL = ("instructions", "SIMD efficiency", "load sectors", "store sectors", "L2 traffic", "DRAM traffic")
LARGEST = 15  # rows of the table of remaining error by kernel


def page(results: Path) -> str:
    """The whole page as Markdown."""
    table = read_results(results)
    times = kernel_times(table)
    sections = (
        _head(results, times),
        _times(times),
        _choices(table),
        _quantities(table),
        _counts_by_kernel(table),
        _left_out(results / LEFT_OUT),
        _intervals(times),
        _remaining(times),
        _machines(),
        _generations(),
    )
    return "\n".join(line for section in sections for line in section)


def _head(results: Path, times: pd.DataFrame) -> Iterator[str]:
    unseen, (mean, worst) = times[~times.seen], TIME_AIM
    means = {place: errors(rows).mean for place, rows in times.groupby(["family", "label"])}
    over = [f"{name} of {system} {_percent(of)} %" for (system, name), of in means.items() if of > KERNEL_AIM]
    yield f"""\
{MARKER}
# How accurate the predictions are

Everything here was computed from runs of `tilestamp reproduce` on machine `h200`, beside what was measured on an H200;
[time.md](time.md) says how a time is made, [machine-model.md](machine-model.md) what explains the errors. A scene
is *seen* where some number was fitted to a cell of it (in that experiment), and *unseen* where none was. The form of
the model was chosen with both in sight: no number was fitted to an unseen scene, but it is not blind. Ratios are
predicted over measured.

![Predicted against measured times of {len(times)} launches, both logarithmic, a colour a system, filled points for \
the {len(unseen)} of unseen scenes: mean error {_percent(errors(times).mean)} %](../{PLOT})

| over 5 us | number | mean (aim {_percent(mean)} %) | worst (aim {_percent(worst)} %) | within {_percent(worst)} % |
| --- | --- | --- | --- | --- |"""
    for name, rows in (("all", times), ("of seen scenes", times[times.seen]), ("of unseen scenes", unseen)):
        found = errors(rows)
        inside = f"{100 * (rows.error.abs() <= worst).mean():.0f} %" if found.cells else ""
        yield _row(name, found.cells, f"{_percent(found.mean)} %", f"{_percent(found.worst)} %", inside)
    yield f"\nKernels whose mean is over {_percent(KERNEL_AIM)} %: {', '.join(over) or 'none'}.\n\nRuns:\n"
    yield from map(_run, sorted(results.glob(SILICON)))


def _run(path: Path) -> str:
    """What made a result, and which scenes it leaves out."""
    manifest = json.loads((path.parent / "manifest.json").read_text("utf-8"))
    left = [warning.partition(" is left out")[0] for warning in manifest["warnings"] if " is left out" in warning]
    without = f"; without {', '.join(left)}" if left else ""
    return f"- {manifest['experiment']}, {manifest['date'][:10]}, sources {manifest['source_digest']}{without}"


def _times(times: pd.DataFrame) -> Iterator[str]:
    yield from _title("Times of kernels over 5 us", "system", "kernel", "measured, us", *_both("mean / worst"))
    for (system, name), rows in times.groupby(["family", "label"]):
        measured = f"{rows.measured.min():.0f} to {rows.measured.max():.0f}"
        yield _row(system, name, measured, *_pair(rows[rows.seen]), *_pair(rows[~rows.seen]))


def _both(what: str) -> list[str]:
    return [f"{which} {column}" for which in ("seen:", "unseen:") for column in ("cells", what, "ratio")]


def _pair(rows: pd.DataFrame) -> list[str]:
    """Cells, errors and ratios of some rows, empty where there is none."""
    found = errors(rows)
    if not found.cells:
        return ["", "", ""]
    return [str(found.cells), _mean_worst(found), f"{found.lowest:.2f} to {found.highest:.2f}"]


def _choices(table: pd.DataFrame) -> Iterator[str]:
    yield from _title("The fastest of several, where they differ by 5 %", "choice", "right", "of")
    for name, pairs in choices(table).items():
        if pairs:
            yield _row(name, sum(measured == ours for measured, ours in pairs), len(pairs))


def _quantities(table: pd.DataFrame) -> Iterator[str]:
    columns = [f"{which} {c}" for which in ("seen:", "unseen:") for c in ("cells", "mean / worst", "within the aim")]
    yield from _title("Counts, bytes and frames", "quantity", "aim", *columns)
    for name, (aim, percent) in AIMS.items():
        rows = table[table.quantity == name]
        aims = ("exact" if not aim else f"{_percent(aim)} %") if percent else f"{aim:g}"
        parts = [_within(some, aim, percent=percent) for some in (rows[rows.seen], rows[~rows.seen])]
        if len(rows):
            yield _row(name, aims, *parts[0], *parts[1])


def _within(rows: pd.DataFrame, aim: float, *, percent: bool) -> list[str]:
    found = errors(rows)
    if not found.cells:
        return ["", "", ""]
    inside = (rows.error.abs() <= aim + 1e-9).mean()
    return [str(found.cells), _mean_worst(found, percent=percent), f"{100 * inside:.0f} %"]


def _counts_by_kernel(table: pd.DataFrame) -> Iterator[str]:
    yield from _title(
        "Counts and bytes by kernel: mean / worst over all scenes, % (efficiency: absolute)", "kernel", *BY_KERNEL
    )
    for (_, name), rows in table[table.quantity.isin(BY_KERNEL)].groupby(["family", "label"]):
        found = [errors(rows[rows.quantity == quantity]) for quantity in BY_KERNEL]
        texts = [_mean_worst(e, percent=AIMS[q][1], unit="") for q, e in zip(BY_KERNEL, found, strict=True)]
        yield _row(name, *(text if e.cells else "" for text, e in zip(texts, found, strict=True)))


def _left_out(path: Path) -> Iterator[str]:
    """Constants refitted without the scene that is predicted, where that experiment was run."""
    if path.is_file():
        yield from _title(
            "A scene left out of the fit that predicts it", "kernel and quantity", "cells", "mean / worst"
        )
        for name, rows in pd.read_csv(path).groupby("column", sort=False):
            found = rows.assign(measured=rows.published)
            yield _row(name, len(rows), _mean_worst(errors(found)))


def _intervals(times: pd.DataFrame) -> Iterator[str]:
    yield from _title(
        f"{_percent(COVERAGE)} % intervals: each experiment in those that the others give",
        "experiment",
        "times",
        "inside",
    )
    for name, count, share in covered(times) if "bound" in times else ():
        yield _row(name, count, f"{100 * share:.1f} %")


def _remaining(times: pd.DataFrame) -> Iterator[str]:
    """Errors by the term that holds, and by kernel and term."""
    if "bound" in times:
        columns = ("times", "mean / worst", "ratio", "share of all error")
        yield from _title("What remains, by the term that holds", "term", *columns)
        yield from _shares(by_bound(times))
        yield from _title(f"The same by kernel: the {LARGEST} largest", "system", "kernel", "term", *columns)
        yield from _shares(by_bound(times, "family", "label")[:LARGEST])


def _shares(groups: Iterable[tuple[tuple[str, ...], Errors, float]]) -> Iterator[str]:
    for name, found, share in groups:
        ratio = f"{found.lowest:.2f} to {found.highest:.2f}"
        yield _row(*name, found.cells, _mean_worst(found), ratio, f"{_percent(share)} %")


def _machines() -> Iterator[str]:
    yield from _title("What each machine file was ever checked against", "machine", "what it is", "checked against")
    yield from (_row(f"`{name}`", *about) for name, about in checked_against().items())


def _generations() -> Iterator[str]:
    title = "Numbers measured, or fitted to what was, on one generation only, and published for none"
    yield from _title(title, "compute capability", "number", "assumed by")
    for where, numbers in on_one_generation().items():
        yield from (_row(where, f"`{key}`", f"{len(files)} files") for key, files in numbers)


def _title(title: str, *columns: str) -> Iterator[str]:
    yield from (f"\n## {title}\n", _row(*columns), _row(*["---"] * len(columns)))


def _row(*texts: object) -> str:
    return f"| {' | '.join(map(str, texts))} |"


def _mean_worst(found: Errors, *, percent: bool = True, unit: str = " %") -> str:
    if not percent:
        return f"{found.mean:.3f} / {found.worst:.3f}"
    return f"{_percent(found.mean)} / {_percent(found.worst)}{unit}"


def _percent(share: float) -> str:
    """A share in percent: one digit after the point below ten."""
    return f"{100 * share:.1f}".removesuffix(".0") if abs(share) < 0.0995 else f"{100 * share:.0f}"


def main(results: Path, root: Path = ROOT) -> None:
    """Write page and plot into a checkout."""
    (root / "docs" / "accuracy.md").write_text(page(results) + "\n", "utf-8")
    times = kernel_times(read_results(results))
    accuracy_plot(times, root / PLOT, title=f"{len(times)} launches on an H200, predicted and measured")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
