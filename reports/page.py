"""The page that a visitor reads: every result with its table, plots and notes, in one HTML file."""

import json
from pathlib import Path
from typing import Any

INTRODUCTION = (
    "Published cells beside what tilestamp computes. How fitted a cell is, is computed: each number that was "
    "fitted on its frame is changed by 1 %, and share is the part of that change that the cell follows. Predicted: "
    "at most 10 %; fitted: at least 90 %, or a number was chosen on this very cell: its error says nothing; "
    "stand-in: of another model than the paper's, which is not here; "
    "reproduced: published by a computation like ours, not measured. Only errors of predicted cells speak of the "
    "model. Red: outside the aim."
)
TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>{{ title }}</title>
<style>
 body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
 h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; border-top: 1px solid #ddd; padding-top: 1.2rem; }
 table { border-collapse: collapse; font-size: 13px; margin: .8rem 0; display: block; overflow-x: auto; }
 td, th { padding: .15rem .6rem; text-align: right; }
 th { border-bottom: 1px solid #999; }
 td:first-child, th:first-child, td:nth-child(2), th:nth-child(2) { text-align: left; }
 tr.fitted td { color: #888; font-style: italic; }
 td:nth-child(n+3):nth-child(-n+9) { white-space: nowrap; }
 td:nth-child(10), th:nth-child(10) { text-align: left; } td:nth-child(10) { font-size: 11px; min-width: 14rem; }
 tr.missed td.error { color: #b00020; font-weight: 600; }
 nav ul { margin: .2rem 0 .8rem; padding-left: 1.2rem; } nav p { margin: .2rem 0; } a { color: #1f5aa6; }
 img { max-width: 100%; } .note { color: #555; } .standin { background: #fff4d6; padding: .4rem .8rem; }
 table.overview td, table.overview th { text-align: left; vertical-align: top; border-bottom: 1px solid #eee; }
 table.overview td { white-space: normal; min-width: 4rem; }
 footer { color: #777; font-size: 12px; margin-top: 3rem; }
</style></head><body>
<h1>{{ title }}</h1>
<p>{{ introduction }}</p>
<nav>{% for group in results | groupby("group") %}<p><b>{{ group.list[0].about }}</b></p><ul>
{% for result in group.list %}
<li><a href="#{{ result.name }}">{{ result.title }}</a></li>{% endfor %}</ul>{% endfor %}</nav>
{% for result in results %}
<h2 id="{{ result.name }}">{{ result.title }}</h2>
<p><b>{{ result.question }}</b> {{ result.answer }}</p>
<p class="note">{{ result.source }}</p>
{% for note in result.warnings %}<p class="standin">{{ note }}</p>{% endfor %}
{% if result.rows %}<table><tr>{% for column in result.columns %}<th>{{ column }}</th>{% endfor %}</tr>
{% for row in result.rows %}<tr class="{{ row.marks }}">{% for value in row.cells %}
<td{% if loop.index0 == result.error_column %} class="error"{% endif %}>{{ value }}</td>{% endfor %}</tr>
{% endfor %}</table>{% endif %}
{% for sentence in result.averages %}<p><b>{{ sentence }}</b></p>
{% endfor %}
{% for figure in result.figures %}<p><img src="{{ figure }}" alt="{{ figure }}"></p>{% endfor %}
{% for note in result.fitted + result.notes %}<p>{{ note }}</p>{% endfor %}
{% endfor %}
<footer>{{ footer }}</footer>
</body></html>
"""


COLUMNS = ("row", "column", "unit", "published", "ours", "error", "status", "aim", "share", "fitted by")


def write_page(folder: Path) -> Path:
    """Render the page over the results that lie in a folder.

    Parameters
    ----------
    folder : Path
        With ``scoreboard.json`` and a folder for each result, each with ``result.json``.

    Returns
    -------
    Path
        The page, ``index.html``.
    """
    from jinja2 import Environment

    scoreboard = json.loads((folder / "scoreboard.json").read_text("utf-8"))
    results = [json.loads((folder / row["name"] / "result.json").read_text("utf-8")) for row in scoreboard["rows"]]
    footer = f"tilestamp {scoreboard['tilestamp']}, sources {scoreboard['source_digest']}"
    title = "tilestamp: papers beside the model"
    page = Environment(autoescape=True).from_string(TEMPLATE)
    sections = [_section(result) for result in results]
    text = page.render(title=title, introduction=INTRODUCTION, results=sections, footer=footer)
    path = folder / "index.html"
    partial = path.with_suffix(".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
    return path


def _section(result: dict[str, Any]) -> dict[str, Any]:
    """One result for the template."""
    name = result["name"]
    rows = [{"cells": _texts(cell), "marks": _marks(cell)} for cell in result["cells"]]
    figures = [f"{name}/{figure['file']}" for figure in result["figures"]]
    return result | {"rows": rows, "figures": figures, "columns": COLUMNS, "error_column": COLUMNS.index("error")}


def _marks(cell: dict[str, Any]) -> str:
    return f"{cell['status'].split()[-1]}{' missed' if cell['missed'] else ''}"


def _texts(cell: dict[str, Any]) -> list[str]:
    fitted_by = "; ".join(f"{name} {100 * part:.0f} %" for name, part in cell["fitted_by"])
    error = "" if cell["error"] is None else f"{100 * cell['error']:+.1f} %"
    numbers = [_number(cell["published"]), _number(cell["ours"])]
    if cell["kind"] == "order":
        error = "as published" if cell["published"] == cell["ours"] else "differs" if cell["published"] else ""
    aim = "" if cell["aim"] is None else f"{100 * cell['aim']:.0f} %"
    share = f"{100 * cell['share']:.0f} %" if cell["status"] in {"predicted", "partly fitted", "fitted"} else ""
    return [cell["row"], cell["column"], cell["unit"], *numbers, error, cell["status"], aim, share, fitted_by]


def _number(value: float | str | None) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
