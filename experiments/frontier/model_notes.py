"""What the charts of the model's frontier say, in sentences: every number from the run."""

import pandas as pd

FULL, BOUNDS, COUNTS = (f"{fidelity}, executed" for fidelity in ("schedule", "bounds", "counts"))


def notes(table: pd.DataFrame, ours: pd.DataFrame, theirs: pd.DataFrame, beside: pd.DataFrame) -> list[str]:
    """Say what the charts show; every number from the run.

    Parameters
    ----------
    table : DataFrame
        A row an answer.
    ours : DataFrame
        A row a method, in the mean.
    theirs : DataFrame
        A row a simulator by others.
    beside : DataFrame
        What the second chart shows.
    """
    return [
        _about(table, ours),
        *_about_others(ours, theirs, beside),
    ]


def _about(table: pd.DataFrame, ours: pd.DataFrame) -> str:
    by = ours.set_index("method")
    full, bounds, counts = by.loc[FULL], by.loc[BOUNDS], by.loc[COUNTS]
    sizes = table[table.method == FULL].instructions / 1e6
    return (
        f"{len(sizes)} frames of {sizes.min():.0f} to {sizes.max():.0f} million warp instructions were simulated in "
        f"each way, without a picture, with compiled kernels; cost is CPU time of all threads. A full run takes "
        f"{full.cpu_seconds:.2f} s a frame. {full.pricing_seconds * 1e3:.0f} ms of them price the counts, the "
        f"rest executes: counts alone, without any time, still take {counts.cpu_seconds:.2f} s. Pricing by bounds "
        f"takes {bounds.pricing_seconds * 1e3:.0f} ms and is {_off(bounds)}."
    )


def _off(row: pd.Series) -> str:
    mean, worst = 100 * row.error_against_full, 100 * row.worst_against_full
    return f"{mean:.2f} % off the full run in the mean, {worst:.2f} % at the worst"


def _about_others(ours: pd.DataFrame, theirs: pd.DataFrame, beside: pd.DataFrame) -> list[str]:
    full = ours.set_index("method").loc[FULL]
    drawn, silent = theirs[theirs.seconds.notna()], theirs[theirs.seconds.isna()]
    direct = int((drawn.speed_mark == "published").sum())
    front = beside[beside.front].sort_values("cost")
    return [
        (
            f"Against published and measured times the full run is {100 * full.error_against_known:.1f} % off in the "
            f"mean. None of these times was fitted, but mixes were on other frames of the same systems, so they are "
            f"easy ones; the tables of this page have the rest."
        ),
        (
            f"Detailed simulators by others would take {_span(drawn.seconds.min())} to {_span(drawn.seconds.max())} "
            f"for the mean frame: its warp instructions over their speed, which {direct} of them publish and "
            f"{len(drawn) - direct} give as a ratio to another. Their errors are the ones they report, each on its own "
            f"workloads and machine, so the heights are not of one race; only the seconds are of one frame."
        ),
        f"{len(silent)} more report an error but no speed that was found: {'; '.join(silent.name)}.",
        f"On the front of the second chart: {'; '.join(front.name)}.",
    ]


def _span(seconds: float) -> str:
    """Seconds as a reader says them."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} seconds"
