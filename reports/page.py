"""The page that a visitor reads: made of what lies in a folder of results, in one HTML file that needs no network.

The folder has ``scoreboard.json`` and, in a folder for each result, ``result.json``. The first screen shows the result
that has the figures ``picture`` and ``heat-map``. Charts are drawn by Vega, whose scripts are in the page once; a
static picture of each, in ``page/``, stands in its place without scripts.
"""

import csv
import json
import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.reports.chart_kinds import table_chart
from tilestamp.reports.chart_scatter import scatter_chart
from tilestamp.reports.page_words import Glossary, error, number, percent

if TYPE_CHECKING:
    from markupsafe import Markup

TEMPLATES = Path(__file__).parent / "templates"
TITLE = "tilestamp: papers beside the model"
FIRST_SCREEN = ("picture", "heat-map")  # figures
COMPARED = ("row", "column", "unit", "published", "ours", "error", "status", "aim", "share", "fitted by")
WIDEST, HIGHEST = 640, 380  # pixels of a plot on the page
ALONE = ("row", "column", "ours", "unit")
BOUNDARIES = ("method", "parameter", "holds", "breaks", "unit", "wrong", "cure", "cost")


def write_page(folder: Path) -> Path:
    """Write the page over all results of a folder.

    Parameters
    ----------
    folder : Path
        Where results lie; ``index.html`` and ``page/`` are written into it.

    Returns
    -------
    Path
        The page.
    """
    from jinja2 import Environment, FileSystemLoader

    scoreboard = json.loads((folder / "scoreboard.json").read_text(encoding="utf-8"))
    sections = [_section(folder, row) for row in scoreboard["rows"] if (folder / row["name"] / "result.json").is_file()]
    scatter = scatter_chart(sections, folder)
    charts = [chart for chart in (scatter, *(one for section in sections for one in section["charts"])) if chart]
    glossary = Glossary.read(TEMPLATES / "glossary.toml")
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"terms": glossary.marked, "number": number, "percent": percent, "error": error}
    text = environment.get_template("page.html.j2").render(
        title=TITLE,
        scoreboard=scoreboard,
        doors=_doors(sections),
        pictures=[_first_screen(section) for section in sections if _first_screen(section)][:1],
        scatter=scatter,
        charts=charts,
        library=_library() if charts else "",
        glossary=glossary.terms,
        footer=f"tilestamp {scoreboard['tilestamp']}, sources {scoreboard['source_digest']}, {scoreboard['date']}",
    )
    path = folder / "index.html"
    partial = path.with_suffix(".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
    return path


@cache
def _library() -> "Markup":
    """Vega, Vega-Lite and their embedding, as one script."""
    from markupsafe import Markup
    from vl_convert import javascript_bundle

    return Markup(javascript_bundle("window.vegaEmbed = vegaEmbed;").replace("</script", "<\\/script"))  # noqa: S704 - a library of ours to trust


def _section(folder: Path, row: dict[str, Any]) -> dict[str, Any]:
    own = folder / row["name"]
    section: dict[str, Any] = json.loads((own / "result.json").read_text(encoding="utf-8"))
    compared = any(cell["published"] is not None for cell in section["cells"])
    files = ["cells.csv", *section["tables"], "manifest.json"]
    return section | {
        "boundaries": _boundaries(own / "boundaries.csv"),
        "seconds": row.get("seconds"),
        "compared": compared,
        "columns": COMPARED if compared else ALONE,
        "files": [file for file in files if (own / file).is_file()],
        "figures": [_figure(own, figure) for figure in section["figures"]],
        "charts": [table_chart(chart, section["name"], folder) for chart in section["charts"]],
    }


def _boundaries(path: Path) -> list[dict[str, str]]:
    """The rows of the stability atlas that a result has."""
    return list(csv.DictReader(path.open(encoding="utf-8", newline=""))) if path.is_file() else []


def _figure(own: Path, figure: dict[str, Any]) -> dict[str, Any]:
    """A plot with its size on paper and its place beside the page."""
    from PIL import Image

    with Image.open(own / figure["file"]) as picture:
        width, height = picture.size
    vector = figure.get("vector")
    return figure | {
        "file": f"{own.name}/{figure['file']}",
        "vector": f"{own.name}/{vector}" if vector else None,
        "width": width,
        "height": height,
        "shown": round(min(WIDEST, HIGHEST * width / height)),
    }


def _first_screen(section: dict[str, Any]) -> dict[str, Any] | None:
    """The picture and its heat map, where a result has both."""
    named = {figure["name"]: figure for figure in section["figures"]}
    if not named.keys() >= set(FIRST_SCREEN):
        return None
    pictures = [named[name] for name in FIRST_SCREEN]
    return {"name": section["name"], "caption": section["answer"], "pictures": pictures}


def _doors(sections: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Doors behind which there is something, each with its sections and the tables over several of them."""
    doors = tomllib.loads((TEMPLATES / "doors.toml").read_text(encoding="utf-8"))["door"]
    known = {group for door in doors for group in door["groups"]}
    for place, door in enumerate(doors):
        own = [s for s in sections if s["group"] in door["groups"] or (place == 0 and s["group"] not in known)]
        door |= {"sections": own, "groups": list(_groups(own))}
    return [door for door in doors if door["sections"]]


def _groups(sections: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Folders of experiments, each with its sections and a table of all their boundaries, where there are any."""
    for name in dict.fromkeys(section["group"] for section in sections):
        own = [section for section in sections if section["group"] == name]
        rows = [
            {"section": section["name"], "cells": [_end(row, column) for column in BOUNDARIES]}
            for section in own
            for row in section["boundaries"]
        ]
        overview = {"rows": rows, "columns": BOUNDARIES, "file": f"{name}.csv"}
        yield {"about": own[0]["about"], "sections": own, "overview": overview if rows else None}


def _end(row: dict[str, str], column: str) -> str:
    """A text of the table of boundaries; of a value that holds, or one that breaks, four digits."""
    if column not in {"holds", "breaks"}:
        return row[column]
    return number(float(row[column])) if row[column] else "none tried"
