"""Write a result into a folder of its own: record, tidy CSV, plots, and a manifest of what made it."""

import json
import shutil
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.harness.record import cell_records, record_of, strict
from tilestamp.experiments.harness.registry import folder_name
from tilestamp.experiments.harness.result import CellFigure, Figure, Result
from tilestamp.experiments.harness.texts import COLUMNS, fitted_by
from tilestamp.models.used import Used
from tilestamp.simulator.manifest import software, used_manifest
from tilestamp.simulator.scenes.library import STAND_INS

if TYPE_CHECKING:
    import pandas as pd

SCRATCH = ".partial-"  # first letters of a folder that is being written
RECORD, MANIFEST, CELLS = "result.json", "manifest.json", "cells.csv"
COMPUTED = ("kind", "missed", "averaged", "frame")  # further columns of the table of cells


@dataclass(frozen=True)
class Making:
    """How a result came about.

    Parameters
    ----------
    options : dict
        As the user gave them; ``command`` is the command line.
    used : dict
        What the experiment used (``tilestamp.models.used.collect``).
    made_from : dict
        What decides the result, as it was when the run began (``tilestamp.experiments.harness.validity``).
    seconds : float
        That it took.
    """

    options: dict[str, Any] = field(default_factory=dict)
    used: Used = field(default_factory=dict)
    made_from: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0


def write_result(result: Result, output: Path, making: Making) -> Path:
    """Write one result into a folder of its own in ``output``, all of it or nothing.

    Parameters
    ----------
    result : Result
    output : Path
    making : Making

    Returns
    -------
    Path
        The result's folder.
    """
    output.mkdir(parents=True, exist_ok=True)
    target = output / folder_name(result.experiment)
    with tempfile.TemporaryDirectory(dir=output, prefix=SCRATCH) as scratch:
        made = Path(scratch) / target.name
        made.mkdir()
        cell_table(result).to_csv(made / CELLS, index=False)
        for name, table in result.tables.items():
            table.to_csv(made / f"{name}.csv", index=False)
        for figure in result.figures:
            draw_figure(figure, result, made / figure.name)
        write_json(
            made / RECORD, record_of(result, made, used_manifest(making.used).get(STAND_INS, {}), making.seconds)
        )
        write_json(made / MANIFEST, _manifest(result, making))
        shutil.rmtree(target, ignore_errors=True)
        made.rename(target)
    return target


def cell_table(result: Result) -> "pd.DataFrame":
    """The cells as a tidy table."""
    import pandas as pd

    both = zip(cell_records(result), result.cells, strict=True)
    records = [record | {"fitted by": fitted_by(cell)} for record, cell in both]
    return pd.DataFrame(records, columns=[*COLUMNS, *COMPUTED])


def write_json(path: Path, value: object) -> None:
    """Write plain data as strict JSON."""
    path.write_text(json.dumps(strict(value), indent=1, allow_nan=False) + "\n", "utf-8")


def draw_figure(figure: Figure | CellFigure, result: Result, path: Path) -> None:
    """Draw a figure of a result: where the path has no suffix, as PNG and as SVG."""
    if isinstance(figure, CellFigure):
        figure.draw(result.cells, path)
    else:
        figure.draw(path)


def _manifest(result: Result, making: Making) -> dict[str, Any]:
    """What made the result: versions and sources, command, all machines, mixes, scenes and runs that it used."""
    return {
        "experiment": result.experiment,
        "source": result.source,
        **software(making.options.get("command", "")),
        "made from": making.made_from,
        "options": {name: value for name, value in making.options.items() if name != "command"},
        "warnings": result.warnings,
        **used_manifest(making.used),
    }
