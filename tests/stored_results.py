"""One result of one cell, and where it is stored."""

import json

from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.harness.validity import made_from, outdated
from tilestamp.experiments.harness.write import Making, write_result

CELL = Cell("row", "column", "ms", published=10.0, ours=11.0, aim=0.2)
NAME = "eisenacher2010/table1"
RESULT = Result(name="eisenacher2010-table1", experiment=NAME, title="Table 1", source="A paper", cells=[CELL])


def write_valid(folder):
    """Write a valid result into a folder."""
    write_result(RESULT, folder, Making(made_from=made_from(NAME)))
    assert outdated(folder, NAME) == ""


def changed(folder, **parts):
    """Let a manifest say that it was made from something else."""
    path = folder / "eisenacher2010-table1" / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps(manifest | {"made from": manifest["made from"] | parts}))
