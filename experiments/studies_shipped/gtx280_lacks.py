"""What the GTX 280 lacked: which of its numbers, changed alone, would have made another tile size the best.

Every number of the machine is multiplied by factors from 1/64 to 64, all else as it was. The frame is that of
Eisenacher & Loop 2010: the killeroo at 1600x1200, for which the paper chose tiles of 8x8.
"""

from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.eisenacher2010.frames import KILLEROO, MACHINE, frame, stand_in_warnings
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Chart, Figure, Result, reported
from tilestamp.experiments.questions.best import Boundary, best_values, boundaries
from tilestamp.experiments.studies_shipped.finding import WHAT_IF, finding
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.reports.plots import lines

QUESTION = "Which number of the GTX 280, changed alone, would have made another tile size the best?"
SLOW = True  # runs when it is named: tilestamp reproduce studies
TILES = (4, 8, 16)
FACTORS = tuple(2.0**power for power in range(-6, 7) if power)
MOST_LINES = 7

CHART = Chart(
    name="scan", kind="lines", table="scan", title="Time of a frame by tile size, as the chosen number alone changes.",
    alt="Lines: time of a frame over the factor of one number of the GTX 280, chosen from a list; a line a tile size.",
    of={"x": "factor", "y": "milliseconds", "color": "tile", "pick": {"number": "Number"},
        "titles": ["factor of the number", "time of a frame [ms]"]},
)  # fmt: skip


def run(progress: Progress) -> Result:
    """Scan each number with three tile sizes."""
    scanned = machines()
    parts = []
    for tile in TILES:
        progress(f"studies_shipped/gtx280_lacks: tiles of {tile}, {len(scanned)} machines")
        priced = frame(tile=tile).prices(list(scanned.values()), skip=True)
        keys = pd.DataFrame(list(scanned), columns=["number", "factor"])
        parts.append(keys.assign(tile=tile, milliseconds=priced.frame))
    table = pd.concat(parts, ignore_index=True).dropna()
    usual = int(best_values(table[table["factor"] == 1], "tile", ["number"])["best"].iloc[0])
    needed = nearest(boundaries(table, "tile", "factor", ["number"], "milliseconds"), usual)
    now = table[(table["factor"] == 1) & (table["number"] == table["number"].iloc[0])]
    cells = [
        reported("as it was", f"{row.tile}x{row.tile} tiles", "ms", row.milliseconds, KILLEROO)
        for row in now.itertuples()
    ]
    cells += [reported(number, f"factor for {tile}x{tile}", "", at, KILLEROO) for (number, tile), at in needed.items()]
    others = [tile for tile in TILES if tile != usual]
    figures = [Figure(f"tiles-of-{tile}", partial(_draw, table, needed, usual, tile)) for tile in others]
    title = "What the GTX 280 lacked: which number, changed alone, makes another tile the best, killeroo, 1600x1200"
    notes = [_usual(now, table["number"].nunique(), usual), *(_sentence(needed, usual, tile) for tile in others)]
    warnings = [WHAT_IF, *stand_in_warnings("killeroo")]
    return finding("gtx280_lacks", title, cells, figures, notes, {"scan": table}, warnings, [CHART])


def machines() -> dict[tuple[str, float], Machine]:
    """Machines by the number that is changed and its factor; the machine itself, with factor 1, for each."""
    base = load_machine(MACHINE)
    found = {}
    for key in base.provenance:
        value = base.number(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not value:
            continue
        found[key, 1.0] = base
        for factor in FACTORS:
            changed = round(value * factor) if isinstance(value, int) else value * factor
            with suppress(TilestampError):  # no machine has it
                if changed:
                    found[key, factor] = altered(base, {key: changed}, "assumed", "a scan")
    return found


def nearest(changes: list[Boundary], usual: int) -> dict[tuple[str, int], float]:
    """The factor nearest to 1 at which another tile is the best, by number and tile; the nearest first."""
    found: dict[tuple[str, int], float] = {}
    for change in sorted(changes, key=lambda change: abs(np.log(change.at))):
        tile = change.after if change.at > 1 else change.before
        if tile != usual:
            found.setdefault((change.place["number"], int(tile)), change.at)
    return found


def _usual(now: pd.DataFrame, scanned: int, usual: int) -> str:
    told = ", ".join(f"{row.milliseconds:.1f} ms with {row.tile}x{row.tile}" for row in now.itertuples())
    return f"As it was, {usual}x{usual} is the fastest: {told}; {scanned} numbers were scanned."


def _sentence(needed: dict[tuple[str, int], float], usual: int, tile: int) -> str:
    """Which numbers would have made a tile the best, and how far off they were."""
    factors = [(number, at) for (number, other), at in needed.items() if other == tile]
    if not factors:
        return f"No single number between 1/64 and 64 times what it was makes {tile}x{tile} the fastest."
    told = ", ".join(f"{number} at {at:.2f} times" for number, at in factors[:MOST_LINES])
    more = f", and {len(factors) - MOST_LINES} more" if len(factors) > MOST_LINES else ""
    return f"{tile}x{tile} instead of {usual}x{usual} needs one of {len(factors)} numbers changed: {told}{more}."


def _draw(table: pd.DataFrame, needed: dict[tuple[str, int], float], usual: int, tile: int, path: Path) -> None:
    """Draw the time of a tile over that of the usual one, by factor, for the numbers that need the least change."""
    near = [number for number, other in needed if other == tile][:MOST_LINES]
    times = table[table["number"].isin(near or list(table["number"].unique())[:MOST_LINES])]
    ratio = times.pivot_table("milliseconds", ["number", "factor"], "tile")
    tidy = (ratio[tile] / ratio[usual]).rename("ratio").reset_index()
    lines(
        tidy, path, x="factor", y="ratio", by="number", log_x=True, log_y=True,
        title=f"{tile}x{tile} against {usual}x{usual}: below 1 it is the faster one",
        x_label="factor of the number", y_label=f"time with {tile}x{tile} / with {usual}x{usual}",
    )  # fmt: skip
