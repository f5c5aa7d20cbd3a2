"""Figure 6: a frame in 1 to 14 batches: time of each stage, GTX 480 (Laine & Karras 2011)."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.experiments.laine2011.sweep import HEIGHT, MACHINE, SOURCE, STAGES, WIDTH
from tilestamp.experiments.laine2011.table3 import CAMERA, FULL, buddha, load_buddha, reduced_warning
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.scenes.search_path import find_scene
from tilestamp.simulator.simulation import simulate

QUESTION = "What does a further batch cost?"
SLOW = True  # with what it needs compiled, more than the first run should take

BATCHES = (1, 2, 4, 8, 14)
FAIRY_STAND_IN = "littlest_tokyo"  # 141,802 triangles of many sizes; FairyForest has 174,117
AIM = 0.5


def run(progress: Progress) -> Result:
    """Draw each scene in several batches, and compare what a further batch costs."""
    cells: list[Cell] = []
    rows = []
    for published_name, name in _scenes().items():
        for batches in BATCHES:
            progress(f"laine2011/figure6: {name}, {batches} batches")
            rows += [{"scene": published_name, **row} for row in _times(name, batches)]
        ours = pd.DataFrame([row for row in rows if row["scene"] == published_name])
        cells += slope_cells(published_name, name, ours)
    table = pd.DataFrame(rows)
    warnings = [reduced_warning()] if "Buddha" in _scenes() and buddha() != FULL else []
    warnings.append(f"STAND-IN for FairyForest: {FAIRY_STAND_IN}, from a fitted camera")
    notes = [
        "Slope: least squares over 1 to 14 batches, ours and theirs. Theirs is the mean over five cameras.",
        ("A further batch costs a launch of each kernel, idle SMs at its end, queues of its own, and tiles read back."),
    ]
    return Result(
        name="laine2011-figure6",
        title="Figure 6: cost of a further batch, 1024x768, GTX 480",
        source=SOURCE,
        cells=cells,
        answer=_answer(cells),
        figures=[Figure(name.lower(), partial(_draw, table[table["scene"] == name], name)) for name in _scenes()],
        notes=notes,
        warnings=warnings,
        tables={"batches": table},
    )


def _answer(cells: list[Cell]) -> str:
    """All stages together, by scene."""
    said = []
    for name in dict.fromkeys(cell.row for cell in cells):
        ours, theirs = (
            sum(float(getattr(c, key) or 0) for c in cells if c.row == name) for key in ("ours", "published")
        )
        said.append(f"{ours:.0f} us for {name} ({theirs:.0f} published)")
    return f"All stages together, {'; '.join(said)}." if said else ""


def _scenes() -> dict[str, str]:
    """Scenes that are here, by the authors' name for what they stand for."""
    found = {"Buddha": buddha(), "FairyForest": FAIRY_STAND_IN if find_scene(FAIRY_STAND_IN) else None}
    return {name: scene for name, scene in found.items() if scene is not None}


def _times(name: str, batches: int) -> list[dict[str, object]]:
    scene, camera = (load_scene(name), "default") if name == FAIRY_STAND_IN else (load_buddha(name), CAMERA)
    made = simulate(scene, "cudaraster", MACHINE, width=WIDTH, height=HEIGHT, camera=camera, batches=batches)
    return [
        {"stage": stage, "batches": batches, "ms": float(made.stages.loc[stage, "milliseconds"])} for stage in STAGES
    ]


def slope_cells(published_name: str, name: str, ours: pd.DataFrame) -> list[Cell]:
    """Milliseconds of a further batch, by stage."""
    rows = _published(published_name)
    cells = []
    for stage, short in STAGES.items():
        theirs = rows[rows["column"] == f"{short}_ms"]
        counts = theirs["key"].str.removeprefix("batches=").astype(int)
        asked = slope(counts.to_numpy(), theirs["value"].to_numpy())
        mine = ours[ours["stage"] == stage]
        found = slope(mine["batches"].to_numpy(), mine["ms"].to_numpy())
        row, column = f"{published_name} ({name})", f"{stage}: a further batch"
        status: Status = "reported" if name == FULL else "stand-in"
        cells.append(Cell(row, column, "us", published=1e3 * asked, ours=1e3 * found, status=status, aim=AIM))
    return cells


def _published(scene: str) -> pd.DataFrame:
    """Rows of the authors' log for one scene."""
    log = published(__file__, "gtx480-cuda40")
    return log[(log["table"] == "figure6") & (log["scene"] == scene) & (log["renderer"] == "CudaRaster")]


def slope(x: np.ndarray[tuple[int], np.dtype[np.int64]], y: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Least-squares slope of y over x."""
    return float(np.polyfit(x, y, 1)[0])


def _draw(table: pd.DataFrame, scene: str, path: Path) -> None:
    rows = _published(scene)
    asked = {(row.key, row.column): row.value for row in rows.itertuples()}
    known = [asked[f"batches={row.batches}", f"{STAGES[row.stage]}_ms"] for row in table.itertuples()]
    lines(
        table.assign(published=known), path, x="batches", y="ms", by="stage", published="published",
        title=f"Stages over batches, in place of {scene}, GTX 480", x_label="batches", y_label="time [ms]",
    )  # fmt: skip
