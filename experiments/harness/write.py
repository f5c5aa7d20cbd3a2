"""Write a result: tidy CSV, a manifest, plots; one page over all results; and one table of all boundaries."""

import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tilestamp
from tilestamp.experiments.harness.registry import describe_folder
from tilestamp.experiments.harness.result import Cell, CellFigure, Figure, Result
from tilestamp.experiments.harness.texts import COLUMNS, averages, cell_texts, fitted_by, number
from tilestamp.models.used import Used
from tilestamp.reports.page import write_page
from tilestamp.simulator.manifest import software, source_digest, used_manifest

if TYPE_CHECKING:
    import pandas as pd

SCRATCH = ".partial-"  # first letters of a folder that is being written
BOUNDARIES = "boundaries"  # a table of results of the stability atlas


def write_result(result: Result, folder: Path, options: dict[str, Any], used: Used | None = None) -> Path:
    """Write one result into a folder of its own in ``folder``, all of it or nothing.

    Parameters
    ----------
    result : Result
    folder : Path
    options : dict
        As the user gave them; ``command`` is the command line.
    used : dict, optional
        What the experiment used (``tilestamp.models.used.collect``).

    Returns
    -------
    Path
        The result's folder.
    """
    import pandas as pd

    folder.mkdir(parents=True, exist_ok=True)
    target = folder / result_folder(result)
    with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as scratch:
        made = Path(scratch) / target.name
        made.mkdir()
        pd.DataFrame([_record(cell) for cell in result.cells], columns=list(COLUMNS)).to_csv(
            made / "cells.csv", index=False
        )
        for name, table in result.tables.items():
            table.to_csv(made / f"{name}.csv", index=False)
        for figure in result.figures:
            draw_figure(figure, result, made / f"{figure.name}.png")
        (made / "manifest.json").write_text(json.dumps(_manifest(result, options, used or {}), indent=1) + "\n")
        shutil.rmtree(target, ignore_errors=True)
        made.rename(target)
    return target


def draw_figure(figure: Figure | CellFigure, result: Result, path: Path) -> None:
    """Draw a figure of a result to a file."""
    if isinstance(figure, CellFigure):
        figure.draw(result.cells, path)
    else:
        figure.draw(path)


def _group(result: Result) -> str:
    """Folder of the experiment: the part of its name before the first dash."""
    return result_folder(result).split("-")[0]


def result_folder(result: Result) -> str:
    """Name of the folder of a result."""
    return result.name.replace("/", "-")


def _record(cell: Cell) -> dict[str, Any]:
    """A cell as a tidy row."""
    return {name: getattr(cell, name) for name in COLUMNS[:-1]} | {COLUMNS[-1]: fitted_by(cell)}


def _manifest(result: Result, options: dict[str, Any], used: Used) -> dict[str, Any]:
    """What made the result: versions and sources, command, all machines, mixes, scenes and runs that it used."""
    return {
        "experiment": result.name,
        "source": result.source,
        **software(options.get("command", "")),
        "options": {name: value for name, value in options.items() if name != "command"},
        "warnings": result.warnings,
        **used_manifest(used),
    }


def write_index(results: Sequence[Result], folder: Path) -> Path:
    """Write the page over all results."""
    path = folder / "index.html"
    introduction = (
        "Published cells beside what tilestamp computes. How fitted a cell is, is computed: each number that was "
        "fitted on its frame is changed by 1 %, and share is the part of that change that the cell follows. Predicted: "
        "at most 10 %; fitted: at least 90 %, or a number was chosen on this very cell: its error says nothing; "
        "reproduced: published by a computation like ours, not measured. Only errors of predicted cells speak of the "
        "model. Red: outside the aim."
    )
    footer = f"tilestamp {tilestamp.__version__}, sources {source_digest()}"
    sections = [_section(result) for result in results]
    for group, table in boundary_tables(results).items():
        table.to_csv(folder / f"{group}.csv", index=False)
        first = next(section for section in sections if section["group"] == group)
        first["overview"] = _overview(group, table)
    write_page(path, "tilestamp: papers beside the model", introduction, sections, footer)
    return path


def boundary_tables(results: Sequence[Result]) -> "dict[str, pd.DataFrame]":
    """All boundaries of each folder of experiments that has any, with the experiment that each was found by."""
    import pandas as pd

    groups: dict[str, list[pd.DataFrame]] = {}
    for result in results:
        if BOUNDARIES in result.tables:
            table = result.tables[BOUNDARIES].copy()
            table.insert(0, "experiment", result.name)
            groups.setdefault(_group(result), []).append(table)
    return {group: pd.concat(tables, ignore_index=True) for group, tables in groups.items()}


def _overview(group: str, table: "pd.DataFrame") -> dict[str, Any]:
    """All boundaries of a folder for the page: a row is the section that it is from, and texts."""
    ends = {"holds", "breaks"}
    columns = ["method", "parameter", "holds", "breaks", "unit", "wrong", "cure", "cost"]
    records = table.to_dict(orient="records")
    return {
        "name": group,
        "title": f"{describe_folder(group).split(':')[0]}: {len(table)} boundaries at one glance",
        "file": f"{group}.csv",
        "columns": columns,
        "rows": [
            {
                "section": str(row["experiment"]).replace("/", "-"),
                "cells": [_end(row[name]) if name in ends else row[name] for name in columns],
            }
            for row in records
        ],
    }


def _end(value: float | None) -> str:
    """A value that holds, or one that breaks."""
    return "none tried" if value is None or value != value else number(value)  # noqa: PLR0124 - not-a-number


def _section(result: Result) -> dict[str, Any]:
    """One result for the page."""
    return {
        "name": result_folder(result),
        "group": _group(result),
        "about": describe_folder(_group(result)),
        "title": result.title,
        "source": result.source,
        "warnings": result.warnings,
        "averages": averages(result),
        "notes": result.notes,
        "columns": COLUMNS,
        "error_column": COLUMNS.index("error"),
        "rows": [
            {"cells": cell_texts(cell), "marks": f"{cell.status.split()[-1]} {'missed' if cell.missed else ''}"}
            for cell in result.cells
        ],
        "figures": [f"{result_folder(result)}/{figure.name}.png" for figure in result.figures],
    }
