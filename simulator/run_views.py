"""Views of a run: a line, a card for a notebook, and plots; plain tables of it, which ``reports`` draws."""

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.priced_frame import PricedFrame

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.card import CardTable
    from tilestamp.reports.style import Into
    from tilestamp.simulator.timeline import LaunchTimeline

Kind = Literal["stages", "terms", "map", "timeline"]
TERM = "_ms"  # end of the names of columns that hold a term of the time
COLUMNS = 1400  # of the picture of a timeline
OF_CARD = {  # columns of the table of stages
    "milliseconds": ".4g",
    "bound": "s",
    "instructions": ",.0f",
    "simd_efficiency": ".3f",
    "ste": ".4f",
    "occupancy": ".2f",
    "dram_bytes": ",.0f",
}


def heading(run: PricedFrame) -> str:
    """Say in a line what was drawn, by what, on what, and how long it takes."""
    return f"{run.scene} by {run.pipeline} on {run.machine.name}, {run.width}x{run.height}: {_time(run)}"


def _time(run: PricedFrame) -> str:
    if not run.counted or run.fidelity == "counts":
        return "counted, not priced" if run.counted else "nothing was counted"
    try:
        milliseconds = run.milliseconds
    except TilestampError as error:  # to say what a run is never fails
        return f"no time ({error})"
    return f"{milliseconds:.4g} ms"


def card(run: PricedFrame) -> str:
    """The picture, the table of stages and what each limit alone would take, as HTML."""
    from tilestamp.reports.card import card as html

    tables = [_stage_card(run), *([_term_card(run)] if run.fidelity != "counts" else [])] if run.counted else []
    sentences = [sentence for sentence in (run.note, *run.frame.remarks) if sentence]
    picture = run.frame.image if run.frame.image.size else None
    return html(heading(run), tables, sentences, picture, f"{run.scene} as {run.pipeline} draws it")


def _stage_card(run: PricedFrame) -> "CardTable":
    from tilestamp.reports.card import CardTable

    stages = run.stages[[name for name in OF_CARD if name in run.stages]]
    rows = [
        [str(stage), *(_text(value, OF_CARD[name]) for name, value in row.items())]
        for stage, row in stages.to_dict(orient="index").items()
    ]
    return CardTable("Stages", ["stage", *(name.replace("_", " ") for name in stages)], rows)


def _term_card(run: PricedFrame) -> "CardTable":
    from tilestamp.reports.card import CardTable

    terms, times = _terms(run), run.stages["milliseconds"].to_numpy(np.float64)
    values = terms.to_numpy(np.float64)
    shares = np.divide(values, times[:, None], out=np.zeros_like(values), where=times[:, None] > 0)
    rows = [
        [str(stage), *(f"{value:.2g}" if value else "" for value in row)]
        for stage, row in zip(terms.index, values, strict=True)
    ]
    coloured = [[0.0, *row] for row in shares.clip(0.0, 1.0).tolist()]
    return CardTable("What each limit alone would take, in milliseconds", ["stage", *terms], rows, coloured)


def _text(value: object, form: str) -> str:
    return "" if value != value else format(value, form)  # noqa: PLR0124 - not-a-number


def _terms(run: PricedFrame) -> "pd.DataFrame":
    """Milliseconds of each term that costs any stage time, a column each."""
    terms = run.stages.filter(regex=f"{TERM}$").fillna(0.0)
    return terms.loc[:, (terms > 0).any()].rename(columns=lambda name: str(name).removesuffix(TERM))


def draw(run: PricedFrame, kind: str, into: "Into" = None, counter: str = "") -> "Axes":
    """Draw one view; see ``Run.plot``.

    Parameters
    ----------
    run : PricedFrame
    kind : str
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    counter : str
        Of a map.
    """
    views: dict[str, Callable[[], Axes]] = {
        "stages": lambda: _stages(run, into),
        "terms": lambda: _term_matrix(run, into),
        "map": lambda: _map(run, into, counter),
        "timeline": lambda: _timeline(run, into),
    }
    if kind not in views:
        raise TilestampError(f"a run has no plot {kind!r}{did_you_mean(str(kind), views)}; it has {', '.join(views)}")
    if kind != "map" and (run.fidelity == "counts" or not run.counted):
        raise TilestampError(f"the plot {kind} shows times, and this run has none; ask for another fidelity")
    return views[kind]()


def _stages(run: PricedFrame, into: "Into") -> "Axes":
    from tilestamp.reports.stage_plots import stage_bars

    ends = {"low_milliseconds": "low", "high_milliseconds": "high"}
    return stage_bars(run.stages[["milliseconds", *ends, "bound"]].rename(columns=ends), into, title=heading(run))


def _term_matrix(run: PricedFrame, into: "Into") -> "Axes":
    from tilestamp.reports.stage_plots import term_matrix

    title = f"{heading(run)}\nMilliseconds that each limit alone would take; dark: near to the time of the stage"
    return term_matrix(_terms(run), run.stages["milliseconds"], into, title=title)


def _map(run: PricedFrame, into: "Into", counter: str) -> "Axes":
    from tilestamp.reports.heatmap import heat_map

    maps = run.frame.maps
    name = counter or next(iter(maps), "map")
    if name not in maps:
        why = ", or only numbers were asked for" if not maps else ""
        has = f"it has {', '.join(maps) or 'none'}{why if run.counted else ' where nothing is counted'}"
        raise TilestampError(f"the pipeline {run.pipeline} draws no map of {name}; {has}")
    by_pixel = maps[name].shape == (run.height, run.width)
    tile, from_below = (1, False) if by_pixel else (run.frame.tile, run.frame.tiles_from_below)
    return heat_map(
        maps[name],
        into,
        title=f"{name}: {run.scene}, {run.pipeline}, {run.width}x{run.height}",
        unit=f"{name} a {'pixel' if by_pixel else 'tile'}",
        size=(run.width, run.height),
        tile=tile,
        from_below=from_below,
    )


def _timeline(run: PricedFrame, into: "Into") -> "Axes":
    from tilestamp.reports.timeline_plot import timeline_plot
    from tilestamp.simulator.timeline import timeline

    launches = list(timeline(run))
    edges = np.linspace(0.0, run.milliseconds * 1e3, COLUMNS + 1)
    stages = list(dict.fromkeys(launch.stage for launch in launches))
    middles = (edges[1:] + edges[:-1]) / 2
    which = np.searchsorted([launch.end for launch in launches], middles).clip(max=len(launches) - 1)
    return timeline_plot(
        sum((taken(launch, edges) for launch in launches), np.zeros((run.machine.sm.count, COLUMNS))),
        np.array([stages.index(launch.stage) for launch in launches])[which],
        middles > np.array([launch.units_end for launch in launches])[which],
        into,
        names=stages,
        title=heading(run),
        x_label="milliseconds",
        y_label="SM",
        end=run.milliseconds,
    )


def taken(launch: "LaunchTimeline", edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of each SM's places that a launch takes between edges, (SMs, columns)."""
    step = edges[1] - edges[0]
    total = np.zeros((launch.sms, len(edges)))
    for times, sign in ((launch.start, 1.0), (launch.stop, -1.0)):
        at = times / step
        begun = np.zeros((2, launch.sms, len(edges)))  # units that began until an edge, and the sum of when
        column = np.ceil(at).astype(np.int64).clip(max=len(edges) - 1)
        np.add.at(begun[0], (launch.sm, column), 1.0)
        np.add.at(begun[1], (launch.sm, column), at)
        count, when = begun.cumsum(axis=2)
        total += sign * (np.arange(len(edges)) * count - when)
    share: NDArray[np.float64] = np.diff(total, axis=1) / launch.slots
    return share
