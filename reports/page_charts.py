"""Charts that a visitor explores, as Vega-Lite: of a table (CSV) that lies beside the page, which is in the chart as it is."""

import csv
import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import altair as alt

STATIC_WIDTH = 640  # pixels of a picture on paper
INK = "currentColor"  # of the page, light or dark
CLOSE = 0.25  # error whose limits are drawn
HEAT = "magma"


def chart_of(chart: dict[str, Any], result: str, folder: Path) -> dict[str, Any]:
    """Make a chart of a result.

    Parameters
    ----------
    chart : dict
        ``name``, ``kind`` (front, lines, sliders, tiles), ``table`` (a file of the result), ``title``, ``alt``, and ``of``:
        what the columns of the table are.
    result : str
        Name of the result, and of its folder.
    folder : Path
        Where results lie.

    Returns
    -------
    dict
        ``name``, ``spec`` (JSON), ``picture`` (a static one, relative to the page), ``alt`` and ``caption``.
    """
    text = (folder / result / chart["table"]).read_text(encoding="utf-8")
    drawn = KINDS[chart["kind"]](text, **chart["of"])
    return _finished(drawn, f"{result}-{chart['name']}", chart["title"], chart["alt"], folder)


def scatter_of(sections: Sequence[dict[str, Any]], folder: Path) -> dict[str, Any] | None:
    """Ours against published, a point a cell that both are numbers of, linked to its row; None where there is none."""
    import altair as alt

    rows = [
        {
            "paper": section["group"], "cell": f"{cell['row']}, {cell['column']}", "unit": cell["unit"],
            "published": cell["published"], "ours": cell["ours"], "error": f"{cell['error']:+.1%}",
            "status": cell["status"], "kind": "times" if cell["kind"] == "time" else "counts",
            "table": section["title"], "link": f"#{section['name']}-{place}",
        }
        for section in sections
        for place, cell in enumerate(section["cells"])
        if cell["error"] is not None and cell["status"] != "reported" and min(cell["published"], cell["ours"]) > 0
    ]  # fmt: skip
    if not rows:
        return None
    kinds = sorted({row["kind"] for row in rows}, reverse=True)  # times first
    kind = alt.param(name="shown", value=kinds[0], bind=alt.binding_radio(options=kinds, name="Cells"))
    ends = {name: _ends([row["published"] for row in rows if row["kind"] == name]) for name in kinds}
    low, high = (alt.ExprRef(f"shown == 'times' ? {ends[kinds[0]][end]} : {ends[kinds[-1]][end]}") for end in (0, 1))
    paper = alt.selection_point(name="paper", fields=["paper"], bind="legend")
    log = alt.Scale(type="log", domain=[low, high], nice=False, clamp=True)
    points = (
        alt.Chart(_data(_csv(rows)))
        .transform_filter("datum.kind == shown")
        .mark_point(size=36, strokeWidth=1.3, aria=False)
        .encode(
            x=alt.X("published:Q", scale=log, title="published or measured"),
            y=alt.Y("ours:Q", scale=log, title="tilestamp"),
            color=alt.Color("paper:N", title="click to single out", legend=alt.Legend(columns=3)),
            fill=alt.condition("datum.status == 'predicted'", alt.Color("paper:N", legend=None), alt.value("transparent")),
            shape=alt.condition("datum.status == 'stand-in'", alt.value("cross"), alt.value("circle")),
            opacity=alt.condition(paper, alt.value(0.85), alt.value(0.06)),
            href="link:N",
            tooltip=["table:N", "cell:N", "unit:N", "published:Q", "ours:Q", "error:N", "status:N"],
        )
        .add_params(kind, paper)
    )
    drawn = alt.layer(*(_diagonal(ends, factor) for factor in (1.0, 1 + CLOSE, 1 - CLOSE)), points)
    counted = {name: sum(row["status"] == name for row in rows) for name in dict.fromkeys(row["status"] for row in rows)}
    told = ", ".join(f"{count} {name}" for name, count in counted.items())
    caption = (
        f"Each point is a cell ({told}), and links to its row. Filled: predicted; hollow: fitted, partly fitted or reproduced; "
        f"crosses: stand-in, of another model than the paper's. On the diagonal both are the same; dotted: {CLOSE:.0%} off; "
        "at the frame: further off than it is wide."
    )
    alt_text = f"Scatter plot, both axes logarithmic: tilestamp's value against the published one of {told} cells."
    return _finished(drawn, "scoreboard", "Published against predicted", alt_text, folder, caption, height=420)


def _ends(published: Sequence[float]) -> tuple[float, float]:
    """Ends of both axes: what is further off is drawn at the frame."""
    return 0.5 * min(published), 2.0 * max(published)


def _diagonal(ends: dict[str, tuple[float, float]], factor: float) -> "alt.Chart":
    import altair as alt

    rows = [{"kind": kind, "published": end, "ours": factor * end} for kind in ends for end in ends[kind]]
    dash = [1, 0] if factor == 1.0 else [2, 3]
    return (
        alt.Chart(_data(_csv(rows)))
        .transform_filter("datum.kind == shown")
        .mark_line(color=INK, strokeWidth=0.8, strokeDash=dash, opacity=0.6, clip=True, aria=False)
        .encode(x="published:Q", y="ours:Q")
    )


def _sliders(text: str, *, sliders: dict[str, str], bar: str, value: str, color: str, unit: str) -> "alt.LayerChart":
    """Bars of the row that sliders point at, beside ticks where all of them are 1."""
    import altair as alt

    rows = list(csv.DictReader(io.StringIO(text)))
    params, tests = [], []
    for place, (column, label) in enumerate(sliders.items()):
        values = sorted({float(row[column]) for row in rows})
        bind = alt.binding_range(min=values[0], max=values[-1], step=values[1] - values[0], name=label)
        params.append(alt.param(name=f"slider{place}", value=1, bind=bind))
        tests.append(f"datum['{column}'] == slider{place}")
    data = _data(text)
    order = list(dict.fromkeys(row[bar] for row in rows))
    at = alt.Chart(data).transform_filter(" && ".join(tests))
    usual = alt.Chart(data).transform_filter(" && ".join(f"datum['{column}'] == 1" for column in sliders))
    x = alt.X(f"{value}:Q", title=unit, scale=alt.Scale(domain=[0, max(float(row[value]) for row in rows)]))
    y = alt.Y(f"{bar}:N", sort=order, title=None)
    tooltip = [f"{bar}:N", alt.Tooltip(f"{value}:Q", format=".4"), f"{color}:N"]
    bars = at.mark_bar().encode(x=x, y=y, color=alt.Color(f"{color}:N", title=color), tooltip=tooltip)
    ticks = usual.mark_tick(color=INK, thickness=2).encode(x=x, y=y)
    total = (
        at.transform_aggregate(total=f"sum({value})")
        .transform_calculate(said=f"'all: ' + format(datum.total, '.4') + ' {unit}'")
        .mark_text(align="right", baseline="bottom", fontSize=15, fontWeight=600, color=INK)
        .encode(x=alt.value(alt.expr("width")), y=alt.value(-6), text="said:N")
    )
    return alt.layer(bars, ticks, total).add_params(*params)


def _front(
    text: str, *, x: str, y: str, color: str, label: str, front: str = "", pick: dict[str, str] | None = None,
    titles: Sequence[str], log_y: bool = True,
) -> "alt.LayerChart":  # fmt: skip
    """Cost against error, lower left is better; what nothing beats is joined."""
    import altair as alt

    data, picked = _picked(text, pick or {})
    only = alt.selection_point(name="only", fields=[color], bind="legend")
    shown = data.transform_filter(f"datum['{x}'] > 0 && isValid(datum['{y}'])")
    scale = alt.Scale(type="symlog", constant=_least(text, y)) if log_y else alt.Scale()
    across, up = alt.X(f"{x}:Q", scale=alt.Scale(type="log"), title=titles[0]), alt.Y(f"{y}:Q", scale=scale, title=titles[1])
    points = (
        shown.mark_point(size=60, filled=True)
        .encode(x=across, y=up, color=_color(text, color), shape=alt.Shape(f"{color}:N"),
                opacity=alt.condition(only, alt.value(0.9), alt.value(0.08)),
                tooltip=[f"{label}:N", alt.Tooltip(f"{x}:Q", format=".4"), alt.Tooltip(f"{y}:Q", format=".4")])
        .add_params(only, *picked)
    )  # fmt: skip
    if not front:
        return alt.layer(points)
    steps = shown.transform_filter(f"datum['{front}'] == 'True'")
    line = steps.mark_line(interpolate="step-after", color=INK, strokeWidth=1).encode(x=across, y=up)
    return alt.layer(line, points)


def _color(text: str, column: str) -> "alt.Color":
    """A colour a value, numbers in their order."""
    import altair as alt

    values = list(dict.fromkeys(row[column] for row in csv.DictReader(io.StringIO(text))))
    ordered = sorted(values, key=float) if all(value.replace(".", "").isdigit() for value in values) else values
    return alt.Color(f"{column}:N", sort=ordered)


def _least(text: str, column: str) -> float:
    """The smallest positive number of a column."""
    values = [float(row[column] or 0) for row in csv.DictReader(io.StringIO(text))]
    return min((value for value in values if value > 0), default=1.0)


def _lines(
    text: str, *, x: str, y: str, color: str, pick: dict[str, str] | None = None, titles: Sequence[str],
    log_x: bool = True, log_y: bool = True,
) -> "alt.Chart":  # fmt: skip
    """Lines by colour, of what is picked."""
    import altair as alt

    data, picked = _picked(text, pick or {})
    return (
        data.mark_line(point=True)
        .encode(x=alt.X(f"{x}:Q", scale=alt.Scale(type="log" if log_x else "linear", nice=False), title=titles[0]),
                y=alt.Y(f"{y}:Q", scale=alt.Scale(type="log" if log_y else "linear"), title=titles[1]),
                color=_color(text, color), tooltip=[f"{color}:N", f"{x}:Q", alt.Tooltip(f"{y}:Q", format=".4")])
        .add_params(*picked)
    )  # fmt: skip


def _tiles(text: str, *, x: str, y: str, value: str, size: Sequence[int]) -> "alt.Chart":
    """A map, a cell a tile, with a slider from which value on tiles are shown; rows count from the top."""
    import altair as alt

    most = max(float(row[value]) for row in csv.DictReader(io.StringIO(text)))
    bind = alt.binding_range(min=0, max=most, step=max(1, round(most / 50)), name=f"Tiles with at least this many {value}")
    least = alt.param(name="least", value=0, bind=bind)
    axis = alt.Axis(grid=False, tickCount=5)
    across, down = alt.Scale(domain=[0, size[0]], nice=False), alt.Scale(domain=[size[1], 0], nice=False)
    return (
        alt.Chart(_data(text), usermeta={"ratio": size[1] / size[0]})
        .transform_filter(f"datum['{value}'] >= least")
        .transform_calculate(right=f"datum['{x}'] + 1", below=f"datum['{y}'] + 1")
        .mark_rect(aria=False)
        .encode(x=alt.X(f"{x}:Q", title=f"tile, {x}", axis=axis, scale=across), x2="right:Q",
                y=alt.Y(f"{y}:Q", title=f"tile, {y}", axis=axis, scale=down), y2="below:Q",
                color=alt.Color(f"{value}:Q", scale=alt.Scale(scheme=HEAT, domain=[0, most])),
                tooltip=[f"{x}:Q", f"{y}:Q", f"{value}:Q"])
        .add_params(least)
    )  # fmt: skip


KINDS: dict[str, Callable[..., Any]] = {"front": _front, "lines": _lines, "sliders": _sliders, "tiles": _tiles}


def _picked(text: str, pick: dict[str, str]) -> "tuple[alt.Chart, list[Any]]":
    """Rows that lists of choices point at, one list a column."""
    import altair as alt

    rows, data, params = list(csv.DictReader(io.StringIO(text))), alt.Chart(_data(text)), []
    for place, (column, name) in enumerate(pick.items()):
        options = list(dict.fromkeys(row[column] for row in rows))
        params.append(alt.param(name=f"pick{place}", value=options[0], bind=alt.binding_select(options=options, name=name)))
        data = data.transform_filter(f"'' + datum['{column}'] == pick{place}")
    return data, params


def _data(text: str) -> "alt.InlineData":
    """CSV as it is."""
    import altair as alt

    return alt.InlineData(values=text, format=alt.CsvDataFormat(type="csv"))


def _csv(rows: Sequence[dict[str, Any]]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _finished(
    drawn: Any, name: str, title: str, alt_text: str, folder: Path, caption: str = "", height: int = 300
) -> dict[str, Any]:
    """A chart as wide as its place, and its static picture."""
    from markupsafe import Markup
    from vl_convert import vegalite_to_svg

    styled = drawn.properties(width="container", height=height, description=alt_text).configure(**_look())
    spec = styled.to_dict()
    picture = folder / "page" / f"{name}.svg"
    picture.parent.mkdir(exist_ok=True)
    still = spec | {"width": STATIC_WIDTH, "config": spec["config"] | {"aria": False}}
    picture.write_text(vegalite_to_svg(still), encoding="utf-8")
    text = json.dumps(spec, separators=(",", ":")).replace("<", "\\u003c")
    return {
        "name": name, "spec": Markup(text), "picture": f"page/{name}.svg", "alt": alt_text,  # noqa: S704 - no "<" in it
        "caption": caption or title,
    }  # fmt: skip


def _look() -> dict[str, Any]:
    """Quiet axes in the colours of the page."""
    ink = dict.fromkeys(("labelColor", "titleColor"), INK)
    return {
        "background": "transparent",
        "font": "system-ui, sans-serif",
        "view": {"stroke": None},
        "axis": ink | {"gridColor": INK, "gridOpacity": 0.12, "domainColor": INK, "tickColor": INK, "labelFontSize": 11},
        "legend": ink | {"orient": "bottom", "columns": 4, "labelLimit": 240},
        "autosize": {"type": "fit-x", "contains": "padding"},
    }
