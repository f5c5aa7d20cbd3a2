"""Results: all experiments, and of a results folder (TILESTAMP_RESULTS) the stability atlas and the roads not taken.

A page in ``docs/exploration`` says ``<!-- result exploration/NAME -->`` where the answer and the plots of a run belong,
and ``docs/why-16x16.md`` likewise.
"""

import json
import os
import re
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
ATLAS, ROADS = "stability", "exploration"
SPLATS = "splats"  # experiments of the page why-16x16.md
RESULT = re.compile(r"<!-- result ((?:exploration|splats)/[a-z]\w*) -->")  # not the NAME of an explanation
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
    made: dict[str, str | bytes] = {"experiments.md": _experiments()} | _atlas()
    for name in experiment_names():
        folder = name.partition("/")[0]
        if folder in {ROADS, SPLATS}:
            made |= {f"{folder}/{place}": path.read_bytes() for place, path in _plots(name).items()}
    return made


def with_results(markdown: str) -> str:
    """A page with the answer and the plots of each run that it asks for."""
    return RESULT.sub(lambda mark: _found(mark[1]), markdown)


def _found(name: str) -> str:
    """What a run found: its answer, what else it noted, its plots."""
    said = _said(name)
    told = [said["answer"], *(f"- {note}" for note in said["notes"] if note != said["answer"])] if said else []
    room = f"{SPLATS}/" if name.startswith(f"{SPLATS}/") else ""
    return "\n\n".join([*told, *_drawn(name, _plots(name), describe(name).rstrip("."), room)])


def _result(name: str) -> Path | None:
    """Where the result of an experiment is, where there is a folder of results."""
    folder = os.environ.get(RESULTS)
    return Path(folder) / name.replace("/", "-") if folder else None


def _said(name: str) -> dict[str, Any]:
    """What a result says, if there is one."""
    result = _result(name)
    path = result / "result.json" if result else None
    return json.loads(path.read_text("utf-8")) if path and path.is_file() else {}


def _plots(name: str) -> dict[str, Path]:
    """Plots of a result, by a name that no other experiment of its folder has."""
    result, short = _result(name), name.partition("/")[2]
    return {f"{short}-{path.name}": path for path in sorted(result.glob("*.png"))} if result else {}


def _drawn(name: str, plots: Mapping[str, Path], title: str, room: str = "") -> list[str]:
    """The plots, as lines of a page; else what draws them."""
    figures = {figure["file"]: figure.get("alt") for figure in _said(name).get("figures", [])}
    drawn = [f"![{figures.get(path.name) or title}]({room}{place}){{ loading=lazy }}" for place, path in plots.items()]
    return drawn or [f"`tilestamp reproduce {name}` draws it."]


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


def _atlas() -> dict[str, str | bytes]:
    made: dict[str, str | bytes] = {}
    thumbnails, sections = "", ""
    for name in experiment_names():
        if not name.startswith(f"{ATLAS}/"):
            continue
        short, title = name.partition("/")[2], describe(name).rstrip(".")
        plots = _plots(name)
        made |= {f"atlas/{place}": path.read_bytes() for place, path in plots.items()}
        drawn = _drawn(name, plots, title, "atlas/")
        parts = [f"## {title} {{ #{short} }}", _about(name), *drawn, _boundaries(_result(name) or Path())]
        sections += "\n\n".join(parts) + "\n\n"
        if plots:
            first = f"atlas/{next(iter(plots))}"
            thumbnails += f'<a href="#{short}"><img src="{first}" alt="" loading="lazy">{escape(short)}</a>\n'
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


TABLES = {"<!-- detailed simulators -->": detailed}
