"""Results: all experiments, and the stability atlas as a gallery of what a results folder has (TILESTAMP_RESULTS)."""

import json
import os
from collections.abc import Mapping
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
        text += f"\n## {describe_folder(group).rstrip('.')}\n\n{table(['experiment', 'question', 'time'], rows)}"
    return text


def _atlas(folder: Path | None) -> dict[str, str | bytes]:
    made: dict[str, str | bytes] = {}
    thumbnails, sections = "", ""
    for name in experiment_names():
        if not name.startswith(f"{ATLAS}/"):
            continue
        short, title = name.partition("/")[2], describe(name).rstrip(".")
        result = folder / name.replace("/", "-") if folder else Path()
        plots = {f"atlas/{short}-{path.name}": path for path in sorted(result.glob("*.png"))} if folder else {}
        made |= {place: path.read_bytes() for place, path in plots.items()}
        drawn = [f"![{_alt(result, path.name, title)}]({place}){{ loading=lazy }}" for place, path in plots.items()]
        drawn = drawn or [f"`tilestamp reproduce {name}` draws it."]
        parts = [f"## {title} {{ #{short} }}", _about(name), *drawn, _boundaries(result)]
        sections += "\n\n".join(parts) + "\n\n"
        if plots:
            thumbnails += (
                f'<a href="#{short}"><img src="{next(iter(plots))}" alt="" loading="lazy">{escape(short)}</a>\n'
            )
    made["atlas.md"] = f'{ATLAS_HEAD}\n<div class="thumbnails">\n{thumbnails}</div>\n\n{sections}'
    return made


def _about(name: str) -> str:
    """The docstring of an experiment but for its first line."""
    module = import_module(f"tilestamp.experiments.{name.replace('/', '.')}")
    return code(cleandoc(module.__doc__ or "").partition("\n")[2].strip())


def _boundaries(result: Path) -> str:
    """Where each method breaks, folded."""
    found = result / "boundaries.csv"
    if not found.is_file():
        return ""
    rows = [
        [row["method"], f"{row['parameter']} [{row['unit']}]", _short(row["holds"]), _short(row["breaks"]), _told(row)]
        for row in pd.read_csv(found, dtype=str, keep_default_na=False).to_dict("records")
    ]
    return f"### Boundaries\n\n{table(['method', 'parameter', 'holds', 'breaks', 'what goes wrong, and a cure'], rows)}"


def _told(row: Mapping[str, str]) -> str:
    cure = f"; cure: {row['cure']}" * bool(row["cure"]) + f" ({row['cost']})" * bool(row["cost"])
    return row["wrong"] + cure


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
