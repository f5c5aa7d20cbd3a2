"""Ru 2016, performance against tile size: occupancy and time of the engine at tiles of 4, 8, 16, 32."""

from collections.abc import Callable

import pandas as pd

from experiments.result import Cell, Figure, Result, Status
from experiments.ru2016.setting import MACHINE, SOURCE, draw, missing, published
from models.machine import load_machine
from models.occupancy import residency
from reports.plots import paired_bars

SLOW = True  # with what it needs compiled, more than the first run should take

REGISTERS = 63  # published
MODEL = "2CylinderEngine"
FITTED_TILE = 8  # the launches of 115 draws are one number, fitted on this cell: here the engine is one draw
DRAWS = 115


def run(progress: Callable[[str], None]) -> Result:
    """Draw the engine at four tile sizes."""
    table = published("tile_size")
    machine = load_machine(MACHINE)
    cells, times = [], {}
    for row in table.to_dict("records"):
        tile = int(row["tile_size"])
        progress(f"tile {tile}")
        held = residency(machine, tile * tile, REGISTERS, 0)
        label = f"{tile}x{tile}"
        cells.append(Cell(label, "occupancy", "%", float(row["occupancy_percent"]), 100.0 * held.occupancy, aim=0.0))
        cells.append(Cell(label, "resident blocks", "blocks", float(row["resident_blocks"]), held.blocks, aim=0.0))
        frame = draw(MODEL, "tiled", tile=tile, capacity="original")
        if frame is not None:
            times[tile] = frame
    notes = ["The engine fills the window here: his view is not known. His two tables disagree on it: 27.2 and 38 ms."]
    rows: list[Cell] = []
    if times:
        asked = dict(zip(table.tile_size, table.ms, strict=True))
        draws = float(asked[FITTED_TILE]) - times[FITTED_TILE].milliseconds
        notes.append(
            f"Fitted at tile {FITTED_TILE}: {draws:.1f} ms for 115 draws of two launches each, "
            f"{1e3 * draws / DRAWS / 2:.0f} us a launch (Windows 10). Times without it are in runs.csv."
        )
        for tile, frame in times.items():
            status: Status = "fitted" if tile == FITTED_TILE else "predicted"
            ours = draws + frame.milliseconds
            rows.append(Cell(f"{tile}x{tile}", "time", "ms", float(asked[tile]), ours, status, aim=0.2))
        order = sorted(times, key=lambda tile: times[tile].milliseconds)
        notes.append(f"Order in time: {' < '.join(map(str, order))} (published: 8 < 4 < 16 < 32).")
    bars = pd.DataFrame([{"tile": c.row, "ours": c.ours, "published": c.published, "status": c.status} for c in rows])
    figures = []
    if rows:
        title = "The engine by tile size (GT 750M)"
        figures.append(
            Figure(
                "time",
                lambda path: paired_bars(
                    bars,
                    path,
                    label="tile",
                    ours="ours",
                    published="published",
                    status="status",
                    title=title,
                    y_label="ms",
                ),
            )
        )
    runs = pd.DataFrame([{"tile": tile, "without_draws_ms": f.milliseconds, **_raster(f)} for tile, f in times.items()])
    warnings = [] if times else missing([MODEL])
    return Result("ru2016-tile_size", "Tile size", SOURCE, cells + rows, figures, notes, warnings, {"runs": runs})


def _raster(frame: object) -> dict[str, float]:
    """Say what the raster kernel did."""
    stages = frame.stages  # type: ignore[attr-defined]
    row = stages.loc["tiled_raster"]
    return {"raster_ms": row.milliseconds, "bound": row.bound, "sample_tests": row.sample_tests, "ste": row.ste}
