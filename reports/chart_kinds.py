"""Kinds of charts of a result's table: cost against error, lines, bars under sliders, a map of tiles."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.reports.charts import INK, data_of, finished, read_rows

if TYPE_CHECKING:
    import altair as alt

    Drawn = alt.Chart | alt.LayerChart | alt.FacetChart
FADED = 0.08
STEPS = 50  # of a slider over counts


def table_chart(chart: Mapping[str, Any], result: str, folder: Path) -> dict[str, Any]:
    """Make a chart of a table of a result.

    Parameters
    ----------
    chart : mapping
        ``name``, ``kind`` (front, lines, sliders, tiles), ``table`` (a file of the result), ``title``, ``alt``, and
        ``of``: arguments of the function of that kind, most of them names of columns.
    result : str
        Name of the result, and of its folder.
    folder : Path
        Of the page.

    Returns
    -------
    dict
        As of ``tilestamp.reports.charts.finished``.
    """
    text = (folder / result / chart["table"]).read_text(encoding="utf-8")
    drawn = KINDS[chart["kind"]](text, **chart["of"])
    return finished(drawn, folder, name=f"{result}-{chart['name']}", caption=chart["title"], alt_text=chart["alt"])


def sliders(text: str, *, sliders: Mapping[str, str], bar: str, value: str, color: str, unit: str) -> "Drawn":
    """Bars of the rows that sliders point at, their sum, and ticks where all sliders are at 1.

    Parameters
    ----------
    text : str
        The table; columns of sliders have the same numbers, evenly apart, in all combinations.
    sliders : mapping of str to str
        Columns, and what is written before the slider.
    bar, value, color : str
        Columns.
    unit : str
        Of the values.
    """
    import altair as alt

    rows = read_rows(text)
    chosen = " && ".join(f"datum['{column}'] == slider{place}" for place, column in enumerate(sliders))
    data = alt.Chart(data_of(text))
    at, usual = data.transform_filter(chosen), data.transform_filter(" && ".join(f"datum['{c}'] == 1" for c in sliders))
    top = max(float(row[value]) for row in rows)
    x = alt.X(f"{value}:Q", title=unit, scale=alt.Scale(domain=[0, top]))
    y = alt.Y(f"{bar}:N", sort=list(dict.fromkeys(row[bar] for row in rows)), title=None)
    tooltip = [f"{bar}:N", alt.Tooltip(f"{value}:Q", format=".4"), f"{color}:N"]
    bars = at.mark_bar().encode(x=x, y=y, color=f"{color}:N", tooltip=tooltip)
    ticks = usual.mark_tick(color=INK, thickness=2).encode(x=x, y=y)
    params = [_slider(rows, place, *column) for place, column in enumerate(sliders.items())]
    return alt.layer(bars, ticks, _sum(at, value, unit)).add_params(*params)


def _slider(rows: Sequence[Mapping[str, str]], place: int, column: str, label: str) -> "alt.Parameter":
    import altair as alt

    values = sorted({float(row[column]) for row in rows})
    bind = alt.binding_range(min=values[0], max=values[-1], step=values[1] - values[0], name=label)
    return alt.param(name=f"slider{place}", value=1, bind=bind)


def _sum(rows: "alt.Chart", value: str, unit: str) -> "alt.Chart":
    """The sum over all bars, at the upper right."""
    import altair as alt

    text: alt.Chart = (
        rows.transform_aggregate(total=f"sum({value})")
        .transform_calculate(said=f"'all: ' + format(datum.total, '.4') + ' {unit}'")
        .mark_text(align="right", baseline="bottom", fontSize=15, fontWeight=600, color=INK)
        .encode(x=alt.value(alt.expr("width")), y=alt.value(-6), text="said:N")
    )
    return text


def front(
    text: str,
    *,
    x: str,
    y: str,
    color: str,
    label: str,
    titles: Sequence[str],
    front: str = "",
    pick: Mapping[str, str] | None = None,
    log_y: bool = True,
) -> "Drawn":
    """Cost against error, lower left is better; ``front``, a column, says what nothing beats: that is joined.

    Parameters
    ----------
    text : str
        The table.
    x, y, color, label : str
        Columns.
    titles : sequence of str
        Of the axes.
    pick : mapping of str to str
        Columns of which one value is chosen from a list, and what is written before the list.
    log_y : bool
        Whether errors grow by factors; zero is drawn at the foot.
    """
    import altair as alt

    data, picked = _picked(text, pick or {})
    shown = data.transform_filter(f"datum['{x}'] > 0 && isValid(datum['{y}'])")
    rows = [row for row in read_rows(text) if float(row[x] or 0) > 0 and row[y]]
    only = alt.selection_point(name="only", fields=[color], bind="legend")
    scale = alt.Scale(type="symlog", constant=_least(text, y)) if log_y else alt.Scale()
    axes = {
        "x": alt.X(f"{x}:Q", scale=alt.Scale(type="log"), title=titles[0]),
        "y": alt.Y(f"{y}:Q", scale=scale, title=titles[1]),
    }
    drawn = shown.mark_point(size=60, filled=True).encode(
        **axes,
        color=alt.Color(f"{color}:N", scale=(same := alt.Scale(domain=_order(rows, color)))),
        shape=alt.Shape(f"{color}:N", scale=same),  # or it has a legend of its own
        opacity=alt.condition(only, alt.value(0.9), alt.value(FADED)),
        tooltip=[f"{label}:N", alt.Tooltip(f"{x}:Q", format=".4"), alt.Tooltip(f"{y}:Q", format=".4")],
    )
    points: alt.Chart = drawn.add_params(only, *picked)
    if not front:
        return points
    steps = shown.transform_filter(f"datum['{front}'] == 'True'")
    line = steps.mark_line(interpolate="step-after", color=INK, strokeWidth=1).encode(**axes)
    return alt.layer(line, points)


def lines(
    text: str,
    *,
    x: str,
    y: str,
    color: str,
    titles: Sequence[str],
    pick: Mapping[str, str] | None = None,
    log: bool = True,
) -> "Drawn":
    """Lines by colour; arguments as of ``front``."""
    import altair as alt

    data, picked = _picked(text, pick or {})
    scale = alt.Scale(type="log", nice=False) if log else alt.Scale()
    drawn: alt.Chart = (
        data.mark_line(point=True)
        .encode(
            x=alt.X(f"{x}:Q", scale=scale, title=titles[0]),
            y=alt.Y(f"{y}:Q", scale=scale, title=titles[1]),
            color=alt.Color(f"{color}:N", sort=_order(read_rows(text), color)),
            tooltip=[f"{color}:N", f"{x}:Q", alt.Tooltip(f"{y}:Q", format=".4")],
        )
        .add_params(*picked)
    )
    return drawn


def tiles(text: str, *, x: str, y: str, value: str, size: Sequence[int]) -> "Drawn":
    """A map, a cell a tile, with a slider from which value on tiles are shown; rows count from the top.

    Parameters
    ----------
    text : str
        The table, a row a tile.
    x, y, value : str
        Columns.
    size : sequence of int
        Columns and rows of the map.
    """
    import altair as alt

    most = max(float(row[value]) for row in read_rows(text))
    step = max(1, round(most / STEPS))
    least = alt.param(
        name="least", value=0, bind=alt.binding_range(min=0, max=most, step=step, name=f"{value} at least")
    )
    across, down = (alt.Scale(domain=list(ends), nice=False) for ends in ((0, size[0]), (size[1], 0)))
    axis = alt.Axis(grid=False, tickCount=5)
    drawn: alt.Chart = (
        alt.Chart(data_of(text), usermeta={"ratio": size[1] / size[0]})
        .transform_filter(f"datum['{value}'] >= least")
        .transform_calculate(right=f"datum['{x}'] + 1", below=f"datum['{y}'] + 1")
        .mark_rect(aria=False)
        .encode(
            x=alt.X(f"{x}:Q", title="tile, from the left", axis=axis, scale=across),
            y=alt.Y(f"{y}:Q", title="tile, from the top", axis=axis, scale=down),
            x2="right:Q",
            y2="below:Q",
            color=alt.Color(f"{value}:Q", scale=alt.Scale(scheme="magma", domain=[0, most])),
            tooltip=[f"{x}:Q", f"{y}:Q", f"{value}:Q"],
        )
        .add_params(least)
    )
    return drawn


KINDS: "dict[str, Callable[..., Drawn]]" = {"front": front, "lines": lines, "sliders": sliders, "tiles": tiles}


def _picked(text: str, pick: Mapping[str, str]) -> "tuple[alt.Chart, list[alt.Parameter]]":
    """Rows that lists of choices point at, one list a column."""
    import altair as alt

    rows, data, params = read_rows(text), alt.Chart(data_of(text)), []
    for place, (column, name) in enumerate(pick.items()):
        options = list(dict.fromkeys(row[column] for row in rows))
        bind = alt.binding_select(options=options, name=name)
        params.append(alt.param(name=f"pick{place}", value=options[0], bind=bind))
        data = data.transform_filter(f"'' + datum['{column}'] == pick{place}")
    return data, params


def _least(text: str, column: str) -> float:
    """The smallest positive number of a column."""
    values = [float(row[column] or 0) for row in read_rows(text)]
    return min((value for value in values if value > 0), default=1.0)


def _order(rows: Sequence[Mapping[str, str]], column: str) -> list[str]:
    """Values of a column for a legend, numbers in their order."""
    values = list(dict.fromkeys(row[column] for row in rows))
    return sorted(values, key=float) if all(value.replace(".", "").isdigit() for value in values) else values
