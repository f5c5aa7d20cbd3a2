"""Ru 2016, performance against tile size: occupancy and time of the engine at tiles of 4, 8, 16, 32."""

from collections.abc import Callable

import pandas as pd

from tilestamp.experiments.harness.cell_bars import cell_bars
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.ru2016.setting import (
    INTEROP,
    MACHINE,
    SOURCE,
    draw,
    frame_ms,
    frame_name,
    missing,
    published,
    waits_ms,
)
from tilestamp.models.machine import load_machine
from tilestamp.models.occupancy import residency
from tilestamp.simulator.run import Run

QUESTION = "Which tile size is the fastest, and what occupancy does each allow?"
SLOW = True  # with what it needs compiled, more than the first run should take

REGISTERS = 63  # published
MODEL = "2CylinderEngine"
PLACE = frame_name(MODEL)
FIGURE = cell_bars(
    "time", lambda cell: cell.column == "time", "The engine by tile size (GT 750M)", "ms", lambda cell: cell.row
)


def run(progress: Callable[[str], None]) -> Result:
    """Draw the engine at four tile sizes."""
    table = published("tile_size")
    times: dict[int, Run] = {}
    for tile in table.tile_size.tolist():
        progress(f"tile {tile}")
        frame = draw(MODEL, "tiled", tile=tile, capacity="original")
        if frame is not None:
            times[tile] = frame
    cells = _occupancy(table)
    rows: list[Cell] = []
    asked = dict(zip(table.tile_size, table.ms, strict=True))
    for tile, frame in times.items():
        ours = frame_ms(frame)
        rows.append(Cell(f"{tile}x{tile}", "time", "ms", published=float(asked[tile]), ours=ours, aim=0.2, frame=PLACE))
    if rows:
        order = " < ".join(str(tile) for tile in sorted(times, key=lambda tile: frame_ms(times[tile])))
        made_of = tuple((cell.row, cell.column) for cell in rows)
        cells.append(Cell("all", "order in time", "", published="8 < 4 < 16 < 32", ours=order, frame=PLACE, of=made_of))
    runs = pd.DataFrame([_row(tile, frame) for tile, frame in times.items()])
    warnings = [] if times else missing([MODEL])
    notes = _notes(times) if times else []
    return Result(
        name="ru2016-tile_size",
        title="Tile size",
        source=SOURCE,
        cells=cells + rows,
        answer=f"In the order of their times: tiles of {order} pixels." if rows else "",
        figures=[FIGURE] if rows else [],
        notes=notes,
        warnings=warnings,
        tables={"runs": runs},
    )


def _occupancy(table: pd.DataFrame) -> list[Cell]:
    """Resident blocks and occupancy of the raster kernel."""
    machine = load_machine(MACHINE)
    cells = []
    for row in table.to_dict("records"):
        tile = int(row["tile_size"])
        held = residency(machine, tile * tile, REGISTERS, 0)
        label = f"{tile}x{tile}"
        cells.append(
            Cell(
                label, "occupancy", "%", published=float(row["occupancy_percent"]), ours=100.0 * held.occupancy, aim=0.0
            )
        )
        cells.append(
            Cell(label, "resident blocks", "blocks", published=float(row["resident_blocks"]), ours=held.blocks, aim=0.0)
        )
    return cells


def _notes(times: dict[int, Run]) -> list[str]:
    """Say where the time goes, and what was fitted."""
    frame = next(iter(times.values()))
    waits = frame.frame.facts["launches that the host waits for"]
    bounds = ", ".join(f"{tile}: {f.stages.loc['tiled_raster'].bound}" for tile, f in times.items())
    return [
        (
            f"{waits} launches a frame, each waited for: {waits_ms(frame):.1f} ms at {frame.machine.launch.sync_us:g} "
            f"us; {INTEROP.number:g} ms to map the window's buffer. The "
            "kernels' instructions, loads and chains are counted by hand from his source, none is fitted."
        ),
        (
            f"What bounds the raster kernel: {bounds}. A warp walks its list one dependent load after another. An SM "
            "holds 16 lists at once at 4x4 and at 8x8, but at 4x4 they are more in all, and dearer to fill; at 16x16 "
            "and 32x32 it holds 4 lists and 1, each longer than that of any tile inside it."
        ),
    ]


def _row(tile: int, frame: Run) -> dict[str, object]:
    """Where a frame's time goes, and what the raster kernel did."""
    row = frame.stages.loc["tiled_raster"]
    return {
        "tile": tile,
        "frame_ms": frame_ms(frame),
        "waits_ms": waits_ms(frame),
        "interop_ms": INTEROP.value,
        **{f"{stage}_ms": float(ms) for stage, ms in frame.stages.milliseconds.items()},
        "raster_bound": row.bound,
        "sample_tests": row.sample_tests,
        "ste": row.ste,
        "list_entries": frame.frame.facts["list entries"],
        "lost_by_overflow": frame.frame.facts["list entries lost by overflow"],
    }
