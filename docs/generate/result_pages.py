"""Results: all experiments, and the stability atlas as a gallery of what a results folder has (TILESTAMP_RESULTS)."""

import json
import os
from html import escape
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Any

import pandas as pd
from texts import code, table

from tilestamp.experiments.harness.registry import FOLDER as EXPERIMENTS
from tilestamp.experiments.harness.registry import describe, describe_folder, experiment_names, is_slow

RESULTS = "TILESTAMP_RESULTS"  # names what `tilestamp reproduce -o FOLDER` left
ATLAS = "stability"
EXPERIMENTS_HEAD = """# Experiments

Each compares published or measured cells with ours, cell by cell, or answers a question.

```sh
tilestamp reproduce                        # the quick ones
tilestamp reproduce eisenacher2010         # of one paper
tilestamp reproduce --all                  # all
```
"""
ATLAS_HEAD = """# The stability atlas

The parameter that breaks each method, where it does, what goes wrong, and what a cure costs. Every boundary is found by
bisection on a small picture, and pinned by a test.

```sh
tilestamp reproduce stability
```
"""
COLUMNS = ["method", "parameter", "unit", "holds", "breaks", "wrong", "cure", "cost"]


def pages() -> dict[str, str | bytes]:
    """The list of experiments, the atlas and its pictures."""
    folder = os.environ.get(RESULTS)
    return {"experiments.md": _experiments()} | _atlas(Path(folder) if folder else None)


def detailed() -> str:
    """What other simulators published of themselves."""
    rows = pd.read_csv(EXPERIMENTS / "frontier" / "detailed_simulators.csv", dtype=str, keep_default_na=False)
    shown = rows[["name", "error_percent", "error_against", "warp_instructions_per_second", "source"]]
    columns = ["simulator", "error, %", "against", "warp instructions a second", "source"]
    return table(columns, [[_short(value) for value in row] for row in shown.itertuples(index=False)])


def _experiments() -> str:
    text = EXPERIMENTS_HEAD
    groups: dict[str, list[str]] = {}
    for name in experiment_names():
        groups.setdefault(name.split("/", maxsplit=1)[0], []).append(name)
    for group, names in groups.items():
        rows = [[f"`{name}`", describe(name), "slow" if is_slow(name) else ""] for name in names]
        text += f"\n## {describe_folder(group).rstrip('.')}\n\n{table(['experiment', 'question', ''], rows)}"
    return text


def _atlas(folder: Path | None) -> dict[str, str | bytes]:
    text = ATLAS_HEAD
    made: dict[str, str | bytes] = {}
    for name in experiment_names():
        if name.startswith(f"{ATLAS}/"):
            result = folder / name.replace("/", "-") if folder else None
            text += f"\n## {describe(name).rstrip('.')}\n\n{_about(name)}\n"
            if result is None or not result.is_dir():
                text += f"\n`tilestamp reproduce {name}` draws it.\n"
                continue
            text += _boundaries(result)
            for path in sorted(result.glob("*.png")):
                place = f"atlas/{result.name}-{path.name}"
                made[place] = path.read_bytes()
                text += f"\n![{escape(_alt(result, path.name, describe(name)))}]({place}){{ loading=lazy }}\n"
    return {"atlas.md": text} | made


def _about(name: str) -> str:
    """The docstring of an experiment but for its first line."""
    module = import_module(f"tilestamp.experiments.{name.replace('/', '.')}")
    return code(cleandoc(module.__doc__ or "").partition("\n")[2].strip())


def _boundaries(result: Path) -> str:
    found = result / "boundaries.csv"
    if not found.is_file():
        return ""
    rows = pd.read_csv(found, keep_default_na=False)[COLUMNS]
    return "\n" + table(COLUMNS, [[_short(value) for value in row] for row in rows.itertuples(index=False)])


def _short(value: object) -> str:
    try:
        return f"{float(str(value)):.5g}"
    except ValueError:
        return str(value)


def _alt(result: Path, name: str, otherwise: str) -> str:
    """What a plot shows, where the result says so."""
    said: dict[str, Any] = json.loads(path.read_text("utf-8")) if (path := result / "result.json").is_file() else {}
    return next(
        (plot["alt"] for plot in said.get("figures", []) if plot["file"] == name and plot.get("alt")), otherwise
    )


TABLES = {"<!-- detailed simulators -->": detailed}
