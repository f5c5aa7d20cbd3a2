"""The chart of the scoreboard: ours against published, a point a cell, linked to the row of its table."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.reports.charts import INK, data_of, finished, write_rows

if TYPE_CHECKING:
    import altair as alt

CLOSE = 0.25  # error whose limits are drawn
KINDS = {"time": "times", "count": "counts"}
HEIGHT = 420  # pixels
FADED = 0.06
Ends = dict[str, tuple[float, float]]


def scatter_chart(sections: Sequence[dict[str, Any]], folder: Path) -> dict[str, Any] | None:
    """Make the chart.

    Parameters
    ----------
    sections : sequence of dict
        Results, as ``result.json`` has them.
    folder : Path
        Of the page.

    Returns
    -------
    dict or None
        As of ``tilestamp.reports.charts.finished``; None where no cell has two numbers to compare.
    """
    import altair as alt

    rows = [row for section in sections for row in _rows(section)]
    if not rows:
        return None
    kinds = [kind for kind in KINDS.values() if any(row["kind"] == kind for row in rows)]
    ends = {kind: _ends([row["published"] for row in rows if row["kind"] == kind]) for kind in kinds}
    guides = [_diagonal(ends, factor) for factor in (1.0, 1.0 + CLOSE, 1.0 - CLOSE)]
    drawn = alt.layer(*guides, _points(rows, ends))
    counted = Counter(row["status"] for row in rows)
    told = ", ".join(f"{number} {status}" for status, number in counted.items())
    caption = (
        f"Each point is a cell in its own unit ({told}), and links to its row. Filled: predicted; hollow: fitted, "
        "partly fitted or reproduced; crosses: stand-in, of another model than the paper's. On the line both are the "
        f"same; dotted: {CLOSE:.0%} off; at the frame: further off than it is wide."
    )
    alt_text = f"Scatter plot, both axes logarithmic: the value of tilestamp against the published one, {told} cells."
    return finished(drawn, folder, name="scoreboard", caption=caption, alt_text=alt_text, height=HEIGHT)


def _rows(section: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Cells of a result that two positive numbers can be compared in."""
    for place, cell in enumerate(section["cells"]):
        if cell["error"] is None or cell["status"] == "reported" or min(cell["published"], cell["ours"]) <= 0:
            continue
        yield {
            "paper": section["group"],
            "cell": f"{cell['row']}, {cell['column']}",
            **{name: cell[name] for name in ("unit", "published", "ours", "status")},
            "error": f"{cell['error']:+.1%}",
            "kind": KINDS[cell["kind"]],
            "table": section["title"],
            "link": f"#{section['name']}-{place}",
        }


def _ends(published: Sequence[float]) -> tuple[float, float]:
    """Ends of both axes: what is further off is drawn at the frame."""
    return 0.5 * min(published), 2.0 * max(published)


def _points(rows: Sequence[dict[str, Any]], ends: Ends) -> "alt.Chart":
    """Points of the kind that is chosen, a colour a paper."""
    import altair as alt

    kinds = list(ends)
    shown = alt.param(name="shown", value=kinds[0], bind=alt.binding_radio(options=kinds, name="Cells"))
    paper = alt.selection_point(name="paper", fields=["paper"], bind="legend")
    domain = [alt.ExprRef(f"shown == '{kinds[0]}' ? {ends[kinds[0]][k]} : {ends[kinds[-1]][k]}") for k in (0, 1)]
    log = alt.Scale(type="log", domain=domain, nice=False, clamp=True)
    colour = alt.Color("paper:N", title="click to single out")
    points: alt.Chart = (
        alt.Chart(data_of(write_rows(rows)))
        .transform_filter("datum.kind == shown")
        .mark_point(size=36, strokeWidth=1.3, aria=False)
        .encode(
            x=alt.X("published:Q", scale=log, title="published or measured"),
            y=alt.Y("ours:Q", scale=log, title="tilestamp"),
            color=colour,
            fill=alt.condition("datum.status == 'predicted'", colour, alt.value("transparent")),
            shape=alt.condition("datum.status == 'stand-in'", alt.value("cross"), alt.value("circle")),
            opacity=alt.condition(paper, alt.value(0.85), alt.value(FADED)),
            href="link:N",
            tooltip=["table:N", "cell:N", "unit:N", "published:Q", "ours:Q", "error:N", "status:N"],
        )
        .add_params(shown, paper)
    )
    return points


def _diagonal(ends: Ends, factor: float) -> "alt.Chart":
    """Line of one ratio; dotted, but for that of 1."""
    import altair as alt

    rows = [{"kind": kind, "published": end, "ours": factor * end} for kind in ends for end in ends[kind]]
    dash = [1, 0] if factor == 1.0 else [2, 3]
    line: alt.Chart = (
        alt.Chart(data_of(write_rows(rows)))
        .transform_filter("datum.kind == shown")
        .mark_line(color=INK, strokeWidth=0.8, strokeDash=dash, opacity=0.6, clip=True, aria=False)
        .encode(x="published:Q", y="ours:Q")
    )
    return line
