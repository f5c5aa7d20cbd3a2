"""A result as plain data and back: what ``result.json`` holds, so that page and scoreboard need no run."""

import math
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import msgspec

from tilestamp.experiments.harness.registry import describe_folder, question
from tilestamp.experiments.harness.result import Cell, Kind, Result
from tilestamp.experiments.harness.scoreboard import Row, row_of
from tilestamp.experiments.harness.texts import answered, averages, disagreements, fitted_numbers
from tilestamp.reports.save import description

FORMAT = 2
NOT_RUN = "not run"
KINDS: tuple[Kind, ...] = ("time", "count")  # of cells that have an error
OF_A_CELL = [field.name for field in fields(Cell)]


def record_of(result: Result, folder: Path, stand_ins: dict[str, str], seconds: float) -> dict[str, Any]:
    """All that is said about a result whose plots and tables lie in ``folder``."""
    answer = answered(result)
    state = NOT_RUN if result.warnings and not result.cells else "done"
    row = row_of(
        result, name=folder.name, question=question(result.experiment), answer=answer, state=state, seconds=seconds
    )
    return {
        "format": FORMAT,
        "experiment": result.experiment,
        "name": folder.name,
        "group": (group := result.experiment.partition("/")[0]),
        "about": describe_folder(group),
        "state": row.state,
        "title": result.title,
        "source": result.source,
        "question": row.question,
        "answer": row.answer,
        "warnings": result.warnings,
        "stand_ins": stand_ins,
        "notes": result.notes,
        "fitted": fitted_numbers(result),
        "averages": averages(result),
        "disagreements": disagreements(result),
        "figures": [_figure(figure.name, folder) for figure in result.figures],
        "charts": [asdict(chart) | {"table": f"{chart.table}.csv"} for chart in result.charts],
        "tables": [f"{name}.csv" for name in result.tables],
        "scoreboard": asdict(row),
        "cells": cell_records(result),
    }


def _figure(name: str, folder: Path) -> dict[str, str | None]:
    file, vector = folder / f"{name}.png", folder / f"{name}.svg"
    alt = description(file) or name
    return {"name": name, "file": file.name, "vector": vector.name if vector.is_file() else None, "alt": alt}


def cell_records(result: Result) -> list[dict[str, Any]]:
    """Each cell with what is computed of it."""
    averaged = {id(cell) for kind in KINDS for cell in result.compared("predicted", kind)}
    return [
        {name: getattr(cell, name) for name in OF_A_CELL}
        | {"kind": cell.kind, "error": cell.error, "missed": cell.missed, "averaged": id(cell) in averaged}
        for cell in result.cells
    ]


def row_from(record: dict[str, Any], outdated: str = "") -> Row:
    """A stored result's row of the scoreboard."""
    row = msgspec.convert(record["scoreboard"], Row)
    return replace(row, outdated=outdated)


def result_of(record: dict[str, Any]) -> Result:
    """The result again, but for its plots and tables."""
    kept = ("title", "source", "answer", "notes", "warnings", "experiment")
    return Result(record["name"], cells=[_cell(cell) for cell in record["cells"]], **{k: record[k] for k in kept})


def _cell(record: dict[str, Any]) -> Cell:
    values = {name: record[name] for name in OF_A_CELL}
    values |= {name: tuple(map(tuple, values[name])) for name in ("of", "fitted_by")}
    return Cell(**values | {"ours": math.nan if values["ours"] is None else values["ours"]})


def strict(value: object) -> object:
    """Plain data as JSON takes it: numbers of Python's, and null for what is no number."""
    if isinstance(value, dict):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [strict(item) for item in value]
    value = value.tolist() if hasattr(value, "tolist") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
