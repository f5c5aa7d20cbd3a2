"""The history of the benchmarks: ``python -m tests.benchmarks.history [pytest's arguments]`` adds a run and plots all.

A run is a line for each benchmark in ``history.csv`` (which git ignores; ``history.png`` shows it): the day, the
commit, the median in milliseconds, its ratio to the yardstick's of the same run, and what else the benchmark noted,
such as the peak of memory. Computers are noisy and unlike: compare ratios.
"""

import json
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).parent
HISTORY = FOLDER / "history.csv"
YARDSTICK = "test_yardstick"


def main() -> None:
    """Run the benchmarks, add them to the history, and plot it."""
    with tempfile.TemporaryDirectory() as scratch:
        found = Path(scratch) / "benchmarks.json"
        arguments = ["-q", "--benchmark-only", f"--benchmark-json={found}", *(sys.argv[1:] or [str(FOLDER)])]
        yardstick = str(FOLDER / "test_bench_yardstick.py")
        subprocess.run([sys.executable, "-m", "pytest", yardstick, *arguments], check=True)  # noqa: S603 - our own tests
        rows = run_rows(json.loads(found.read_text()), _commit(), datetime.now(UTC).date().isoformat())
    history = pd.concat([pd.read_csv(HISTORY), rows] if HISTORY.exists() else [rows], ignore_index=True)
    history.to_csv(HISTORY, index=False)
    plot(history, FOLDER / "history.png")
    sys.stdout.write(f"{len(rows)} benchmarks added to {HISTORY}\n")


def run_rows(report: dict, commit: str, day: str) -> pd.DataFrame:
    """Lines of the history from one report of pytest-benchmark."""
    medians = {made["name"]: made["stats"]["median"] for made in report["benchmarks"]}
    noted = {made["name"]: json.dumps(made["extra_info"]) for made in report["benchmarks"] if made.get("extra_info")}
    rule, about = medians.pop(YARDSTICK), {"day": day, "commit": commit}
    return pd.DataFrame(
        [
            {**about, "benchmark": name, "ms": round(1e3 * s, 3), "ratio": s / rule, "noted": noted.get(name, "")}
            for name, s in medians.items()
        ]
    )


def plot(history: pd.DataFrame, path: Path) -> None:
    """Draw the ratio of each benchmark to the yardstick, run after run."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    runs = list(dict.fromkeys(zip(history["day"], history["commit"], strict=True)))
    figure, axes = plt.subplots(figsize=(9, 6), layout="constrained")
    for name, rows in history.groupby("benchmark"):
        places = [runs.index(run) for run in zip(rows["day"], rows["commit"], strict=True)]
        axes.plot(places, rows["ratio"], marker="o", markersize=3, linewidth=1, label=name)
    axes.set(yscale="log", xlabel="run", ylabel="median / median of the yardstick", title="Benchmarks, run after run")
    axes.set_xticks(range(len(runs)), [f"{day}\n{commit}" for day, commit in runs])
    figure.legend(loc="outside right upper", fontsize=6, frameon=False)
    figure.savefig(path, dpi=120)


def _commit() -> str:
    command = ["git", "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, cwd=FOLDER, capture_output=True, text=True, check=False)  # noqa: S603 - a fixed command
    return done.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
