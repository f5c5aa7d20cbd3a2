"""Charts that a visitor of the page explores, in Vega-Lite; each has a table (CSV) as it lies beside the page.

Colours of text are those of the page, light or dark. The static picture of a chart is for paper and for no scripts.
"""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import altair as alt

INK = "currentColor"  # of the page
STATIC_WIDTH = 640  # pixels of a picture on paper
HEIGHT = 300


def read_rows(text: str) -> list[dict[str, str]]:
    """Rows of a table."""
    return list(csv.DictReader(io.StringIO(text)))


def write_rows(rows: Sequence[dict[str, Any]]) -> str:
    """A table of rows."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def data_of(text: str) -> "alt.InlineData":
    """A table for Vega, as it is."""
    import altair as alt

    return alt.InlineData(values=text, format=alt.CsvDataFormat(type="csv"))


def finished(
    drawn: "alt.TopLevelMixin", folder: Path, *, name: str, caption: str, alt_text: str, height: int = HEIGHT
) -> dict[str, Any]:
    """Make a chart as wide as its place, and write its static picture.

    Parameters
    ----------
    drawn : Chart or LayerChart
    folder : Path
        Of the page; the picture is written to ``page/`` in it.
    name, caption, alt_text : str
        ``alt_text`` says what is to be seen.
    height : int
        In pixels.

    Returns
    -------
    dict
        ``name``, ``spec`` (JSON for a script element), ``picture`` (relative to the page), ``alt`` and ``caption``.
    """
    from markupsafe import Markup
    from vl_convert import vegalite_to_svg

    spec = drawn.to_dict() | {"width": "container", "height": height, "description": alt_text, "config": _look()}
    picture = folder / "page" / f"{name}.svg"
    picture.parent.mkdir(exist_ok=True)
    still = spec | {"width": STATIC_WIDTH, "config": {**_look(), "aria": False}}
    picture.write_text(vegalite_to_svg(still), encoding="utf-8")
    text = json.dumps(spec, separators=(",", ":")).replace("<", "\\u003c")
    safe = Markup(text)  # noqa: S704 - no "<" is left
    return {"name": name, "spec": safe, "picture": f"page/{picture.name}", "alt": alt_text, "caption": caption}


def _look() -> dict[str, Any]:
    """Quiet axes in the colours of the page."""
    ink = dict.fromkeys(("labelColor", "titleColor"), INK)
    lines = {"gridColor": INK, "gridOpacity": 0.12, "domainColor": INK, "tickColor": INK}
    return {
        "background": "transparent",
        "font": "system-ui, sans-serif",
        "view": {"stroke": None},
        "axis": {**ink, **lines, "labelFontSize": 11},
        "legend": {**ink, "orient": "bottom", "columns": 4, "labelLimit": 240},
        "autosize": {"type": "fit-x", "contains": "padding"},
    }
