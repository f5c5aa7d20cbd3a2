"""Table 1: bucketing 270 k sub-patches by tiles of 4, 8, 16 and 32 pixels (Eisenacher & Loop 2010)."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from tilestamp.experiments.eisenacher2010.frames import KILLEROO, SOURCE, frame, stage_ms, stand_in_warnings
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.work import Work

QUESTION = "Why does bucketing take longer with larger tiles?"
SUBPATCHES = 270_000  # as printed
COUNT_AIM, TIME_AIM = 0.02, 0.10
CONFLICTS = {
    "lanes that conflict": "ATOMIC_CONFLICTS",
    "passes by 32-byte lock": "LOCK_DEPTH",
    "requests": "ATOMIC_REQUESTS",
}


def run(progress: Progress) -> Result:
    """Count and price the bucketing of one frame at four tile sizes."""
    cells: list[Cell] = []
    rows = []
    for line in published(__file__, "table1").itertuples():
        progress(f"eisenacher2010/table1: tiles of {line.tile_size}")
        made = bucketing(frame(tile=int(line.tile_size), fidelity="counts"))
        cells += _cells(line, made)
        rows.append({"tile": line.tile_size, "published": line.address_calc_ms, **_why(made)})
    table = pd.DataFrame(rows)
    made_patches = made.frame.facts["subpatches"]
    cells.insert(
        0, Cell("all tiles", "sub-patches", "", published=SUBPATCHES, ours=made_patches, aim=COUNT_AIM, frame=KILLEROO)
    )
    return Result(
        name="eisenacher2010-table1",
        title="Table 1: bucketing by tile size, killeroo, 1600x1200, bounding box 4, GTX 280",
        source=SOURCE,
        cells=cells,
        answer=f"The address calculation takes {table['ours'].iloc[0]:.2f} ms with tiles of 4 pixels and "
        f"{table['ours'].iloc[-1]:.2f} ms with 32, where the fullest lock has {_growth(table)} as many requests.",
        figures=[Figure("address_calculation", lambda path: _draw(table, path))],
        notes=[
            (
                "Why large tiles are slower: fewer requests are sent, but more of them want a lock that is taken; "
                "the fullest "
                f"lock has {_growth(table)} as many requests at 32-pixel tiles as at 4."
            ),
            (
                "The form of the atomic model (conflicts in a warp, and a queue at the fullest lock) was chosen "
                "with all four cells in sight; its two numbers were fitted at tiles of 4 and 32."
            ),
        ],
        warnings=stand_in_warnings("killeroo"),
        tables={"conflicts": table},
    )


def bucketing(made: Run) -> Run:
    """Price what was counted without the tile raster: a GTX 280 cannot launch the 1024 threads of a 32-pixel tile."""
    works = [work for work in made.frame.works if work.stage != "tile_raster"]
    return replace(made, frame=replace(made.frame, works=works), fidelity="schedule")


def _cells(line: "pd.Series[float]", made: Run) -> list[Cell]:
    tile = int(line.tile_size)
    written = made.frame.facts["patches_written"]
    per_patch = written / made.frame.facts["subpatches"]
    row = f"{tile}x{tile}"
    cell = partial(Cell, row, frame=KILLEROO)
    parts = ("all tiles", "sub-patches"), (row, "patches written")
    calculated, wrote = (stage_ms(made, stage) for stage in ("bucket_count", "bucket_write"))
    return [
        cell("address calculation", "ms", published=line.address_calc_ms, ours=calculated, aim=TIME_AIM),
        cell("bucket write", "ms", published=line.bucket_write_ms, ours=wrote, aim=TIME_AIM),
        cell("patches written", "", published=line.patches_written, ours=written, aim=COUNT_AIM),
        cell("tiles per patch", "", published=line.tiles_per_patch, ours=per_patch, aim=COUNT_AIM, of=parts),
    ]


def _why(made: Run) -> dict[str, float]:
    """What makes the address calculation slow."""
    queues = [work.atomic_requests for work in made.frame.works if isinstance(work, Work)]
    fullest = max(int(queue.max()) for queue in queues if queue is not None)
    counts = {label: made.counts[f"bucket_count.{name}"] for label, name in CONFLICTS.items()}
    return {"ours": stage_ms(made, "bucket_count"), "fullest lock": fullest, **counts}


def _growth(table: pd.DataFrame) -> str:
    return f"{table['fullest lock'].iloc[-1] / table['fullest lock'].iloc[0]:.0f} times"


def _draw(table: pd.DataFrame, path: Path) -> None:
    labelled = table.assign(stage="address calculation, model")
    lines(
        labelled, path, x="tile", y="ours", by="stage", published="published",
        title="Address calculation by tile size (fitted at 4 and 32)", x_label="tile [pixels a side]",
        y_label="time [ms]",
    )  # fmt: skip
