"""The results folder: what lies in it, its scoreboard, its tables over several results, and the page over all of it."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tilestamp
from tilestamp.experiments.harness.record import FORMAT, NOT_RUN, row_from
from tilestamp.experiments.harness.registry import experiment_names
from tilestamp.experiments.harness.scoreboard import Row, flat, total
from tilestamp.experiments.harness.validity import outdated
from tilestamp.experiments.harness.write import MANIFEST, RECORD, write_json
from tilestamp.reports.page import write_page
from tilestamp.simulator.manifest import source_digest
from tilestamp.simulator.scenes.search_path import SCENES_VARIABLE

SCOREBOARD = "scoreboard"
BOUNDARIES = "boundaries.csv"  # a table of results of the stability atlas
TOLD = 3  # results out of date that are named
Record = dict[str, Any]


def rebuild(output: Path) -> tuple[list[Row], list[str], Path]:
    """Write scoreboard, overviews and page anew from the results that lie in a folder.

    Returns
    -------
    rows : list of Row
        The scoreboard, a row a result.
    advice : list of str
        What to do for more, and for real models.
    page : Path
    """
    records = stored(output)
    rows = [row_from(record, outdated(output, record["experiment"])) for record in records]
    said = advice(records, rows)
    _write_scoreboard(output, rows, said, _newest(output, records))
    _write_overviews(output, records)
    return rows, said, write_page(output)


def stored(output: Path) -> list[Record]:
    """The results that lie in a folder, in the order of all experiments; none that another version wrote otherwise."""
    order = {name: index for index, name in enumerate(experiment_names())}
    records = [json.loads(path.read_text("utf-8")) for path in sorted(output.glob(f"*/{RECORD}"))]
    records = [record for record in records if record.get("format") == FORMAT]
    return sorted(records, key=lambda record: order.get(record["experiment"], len(order)))


def advice(records: Sequence[Record], rows: Sequence[Row]) -> list[str]:
    """What to do to get the real models, what was not run, and what is out of date."""
    said = []
    absent = sorted({file for record in records for file in record["stand_ins"].values()})
    if absent:
        files = ", ".join(absent)
        number = sum(row.stand_ins for row in rows)
        cells = f"{number} {'cell' if number == 1 else 'cells'} of stand-ins say nothing of the model"
        said.append(
            f"{cells if number else 'stand-ins were drawn'}: put {files} into a folder, name that folder in "
            f"{SCENES_VARIABLE}, and reproduce: what they change is run again"
        )
    lacking = [(r["experiment"], " ".join(r["warnings"])) for r in records if r["state"] == NOT_RUN]
    said += [f"{name} was not run: {why.removeprefix('not run: ')}" for name, why in lacking]
    old = [row.experiment for row in rows if row.outdated and row.state != NOT_RUN]
    if old:
        why = next(row.outdated for row in rows if row.experiment == old[0])
        count = "1 result is" if len(old) == 1 else f"{len(old)} results are"
        more = f" and {len(old) - TOLD} more" if len(old) > TOLD else ""
        said.append(f"{count} out of date ({why}); run again where named: {', '.join(old[:TOLD])}{more}")
    return said


def _newest(output: Path, records: Sequence[Record]) -> str:
    """When the newest result was made, so that a page made again is the same page."""
    return max((json.loads((output / r["name"] / MANIFEST).read_text("utf-8"))["date"] for r in records), default="")


def _write_scoreboard(output: Path, rows: Sequence[Row], said: Sequence[str], date: str) -> None:
    import pandas as pd

    about = {"format": FORMAT, "tilestamp": tilestamp.__version__, "source_digest": source_digest(), "date": date}
    numbers = {"rows": [asdict(row) for row in rows], "total": asdict(total(rows)), "advice": list(said)}
    write_json(output / f"{SCOREBOARD}.json", about | numbers)
    table = pd.DataFrame([flat(row) for row in rows], columns=list(flat(Row())))
    table.to_csv(output / f"{SCOREBOARD}.csv", index=False)


def _write_overviews(output: Path, records: Sequence[Record]) -> None:
    """All boundaries of each group of experiments that has any, with the experiment that each was found by."""
    import pandas as pd

    groups: dict[str, list[pd.DataFrame]] = {}
    for record in records:
        if BOUNDARIES in record["tables"]:
            table = pd.read_csv(output / record["name"] / BOUNDARIES)
            table.insert(0, "experiment", record["experiment"])
            groups.setdefault(record["group"], []).append(table)
    for group, tables in groups.items():
        pd.concat(tables, ignore_index=True).to_csv(output / f"{group}.csv", index=False)
