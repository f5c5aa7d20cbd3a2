"""The page that a visitor reads: every result with its table, plots and notes, in one HTML file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
{% for result in group.list %}{% if result.overview %}
<li><a href="#{{ result.overview.name }}">{{ result.overview.title }}</a></li>{% endif %}
<li><a href="#{{ result.name }}">{{ result.title }}</a></li>{% endfor %}</ul>{% endfor %}</nav>
{% for result in results %}{% if result.overview %}{% set overview = result.overview %}
<h2 id="{{ overview.name }}">{{ overview.title }}</h2>
<p class="note">As a table: <a href="{{ overview.file }}">{{ overview.file }}</a></p>
<table class="overview"><tr>{% for column in overview.columns %}<th>{{ column }}</th>{% endfor %}</tr>
{% for row in overview.rows %}<tr>{% for value in row.cells %}<td>{% if loop.first %}<a href="#{{ row.section }}">
{{ value }}</a>{% else %}{{ value }}{% endif %}</td>{% endfor %}</tr>
{% endfor %}</table>{% endif %}
<h2 id="{{ result.name }}">{{ result.title }}</h2>
<p class="note">{{ result.source }}</p>
{% for note in result.warnings %}<p class="standin">{{ note }}</p>{% endfor %}
{% if result.rows %}<table><tr>{% for column in result.columns %}<th>{{ column }}</th>{% endfor %}</tr>
{% for row in result.rows %}<tr class="{{ row.marks }}">{% for value in row.cells %}
<td{% if loop.index0 == result.error_column %} class="error"{% endif %}>{{ value }}</td>{% endfor %}</tr>
{% endfor %}</table>{% endif %}
{% for sentence in result.averages %}<p><b>{{ sentence }}</b></p>
{% endfor %}
{% for figure in result.figures %}<p><img src="{{ figure }}" alt="{{ figure }}"></p>{% endfor %}
{% for note in result.notes %}<p>{{ note }}</p>{% endfor %}
{% endfor %}
<footer>{{ footer }}</footer>
</body></html>
"""


def write_page(path: Path, title: str, introduction: str, results: Sequence[dict[str, Any]], footer: str) -> None:
    """Render the page.

    Parameters
    ----------
    path : Path
        HTML file to write.
    results : sequence of dict
        Each with name, group and what the group is about, title, source, warnings, columns, rows (cells and marks),
        error_column, averages (sentences), figures (paths relative to the page) and notes; and perhaps ``overview``, a
        table to stand before it: name, title, file, columns, rows (the section that a row is from, and cells).
    """
    from jinja2 import Environment

    page = Environment(autoescape=True).from_string(TEMPLATE)
    text = page.render(title=title, introduction=introduction, results=results, footer=footer)
    partial = path.with_suffix(".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
