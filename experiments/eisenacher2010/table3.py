"""Table 3: time of each stage, hybrid and software at 1, 4 and 16 samples a pixel (Eisenacher & Loop 2010)."""

from dataclasses import replace
from pathlib import Path

import pandas as pd

from tilestamp.experiments.eisenacher2010.frames import (
    KILLEROO,
    OVERHEAD,
    SOURCE,
    frame,
    overhead_ms,
    stage_ms,
    stand_in_warnings,
)
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.reports.bars import stacked_bars
from tilestamp.simulator.run import Run
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent as E
from tilestamp.simulator.work import Work

QUESTION = "How long does each stage take, in software and in the hybrid?"
STAGE_AIM, TOTAL_AIM = 0.20, 0.10
SPLIT_MS, HYBRID_SPLIT_MS = 7.7 + 1.5, 7.7
DICE_MS, COUNT_MS, SORT_MS, SETUP_MS = 6.0, 2.5, 0.3, 8.2
SAMPLING_MS = {1: 46.2, 4: 110.6, 16: 261.4}
TOTAL_MS = {1: 77.0, 4: 140.6, 16: 290.2}
HYBRID_SAMPLING_MS, HYBRID_TOTAL_MS = 19.0, 37.2
STAGES = ("system overhead", "bound and split", "evaluate grid", "count", "sort", "setup")  # the same at any spp
SHARED_MS = {"overhead": OVERHEAD.number, "dice": DICE_MS}
SOFTWARE_MS = {"bound_and_split": SPLIT_MS, "count": COUNT_MS, "sort": SORT_MS, "setup": SETUP_MS}
PUBLISHED_MS = {
    **{f"{spp} spp": {**SHARED_MS, **SOFTWARE_MS, "sampling": ms} for spp, ms in SAMPLING_MS.items()},
    "hybrid": {**SHARED_MS, "bound_and_split": HYBRID_SPLIT_MS, "hardware": HYBRID_SAMPLING_MS},
}
STARTED = (E.PIXEL_WARPS, E.PIXEL_LANES, E.GRIDS, E.BATCHES, E.BATCH_WARPS, E.GATHER_WARPS, E.GATHER_LANES)
MOVED = (E.BARRIERS, E.LOAD_TRANSACTIONS, E.LOAD_BYTES, E.STORE_TRANSACTIONS, E.STORE_BYTES)


def run(progress: Progress) -> Result:
    """Price the stages of one frame."""
    cells: list[Cell] = []
    stages: dict[str, dict[str, float]] = {}
    for spp in SAMPLING_MS:
        progress(f"eisenacher2010/table3: {spp} spp")
        made = frame(spp=spp)
        stages[f"{spp} spp"] = _software_stages(made)
        cells += _software_cells(spp, stages[f"{spp} spp"])
    progress("eisenacher2010/table3: hybrid")
    hybrid = frame(hybrid=True)
    stages["hybrid"] = {
        "overhead": overhead_ms(hybrid),
        **{stage: stage_ms(hybrid, stage) for stage in ("bound_and_split", "dice", "hardware")},
    }
    cells += _hybrid_cells(stages["hybrid"], sum(stages["1 spp"].values()))
    notes = [
        (
            "Fitted numbers stand for what is not published: the block launch rate (setup is taken to be the "
            "start of 30,000 blocks, of which most are empty), what lanes cost that pass the z-test (sampling), "
            "primitives a clock (hardware). All else of sampling, bound and split and evaluate grid is counted "
            "by hand; without the cost of lanes, sampling takes 41, 87 and 237 ms."
        ),
        "Setup is the tile raster without its quads; sampling is the rest.",
        ("7.7 + 1.5 ms of bound and split are read as one figure: 270 k / 9.2 ms is the 29.4 M patches/s of the text."),
    ]
    title = "Table 3: stages, killeroo, 1600x1200, 8x8 tiles, bounding box 4, GTX 280"
    figures = [Figure("stages", lambda path: _draw(stages, path))]
    warnings = stand_in_warnings("killeroo")
    return Result(
        "eisenacher2010-table3", title, SOURCE, cells, _answer(stages), figures=figures, notes=notes, warnings=warnings
    )


def _answer(stages: dict[str, dict[str, float]]) -> str:
    """What takes longest in software, and what the hybrid saves."""
    software, hybrid = stages["1 spp"], sum(stages["hybrid"].values())
    total = sum(software.values())
    return (
        f"Sampling takes {software['sampling'] / total:.0%} of a frame in software at one sample a pixel; with the "
        f"rasterizer of the GPU in its place a frame takes {hybrid:.1f} ms instead of {total:.1f}."
    )


def _software_stages(made: Run) -> dict[str, float]:
    """Milliseconds by the paper's rows."""
    setup = setup_ms(made)
    return {
        "overhead": overhead_ms(made),
        "bound_and_split": stage_ms(made, "bound_and_split"),
        "dice": stage_ms(made, "dice"),
        "count": stage_ms(made, "bucket_count"),
        "sort": stage_ms(made, "bucket_scan", "bucket_write"),
        "setup": setup,
        "sampling": stage_ms(made, "tile_raster") - setup,
    }


def setup_ms(made: Run) -> float:
    """Time of the tile raster without its quads: blocks start, grids are loaded, pixels are written."""
    raster = next(work for work in made.frame.works if isinstance(work, Work) and work.stage == "tile_raster")
    table = raster.table.copy()
    table[:, [event for event in E if event not in (*STARTED, *MOVED)]] = 0
    bare = replace(made, frame=replace(made.frame, works=[replace(raster, table=table)]))
    return bare.milliseconds


def _software_cells(spp: int, ours: dict[str, float]) -> list[Cell]:
    """Cells of one column; the stages above sampling are printed once, under 1 spp."""
    column = f"{spp} spp"
    asked = (OVERHEAD.number, SPLIT_MS, DICE_MS, COUNT_MS, SORT_MS, SETUP_MS)
    stages = zip(STAGES, asked, ours.values(), strict=False)  # of ours sampling is left
    cells = [_cell(row, column, ms, mine) for row, ms, mine in stages] if spp == 1 else []
    made_of = (*((row, "1 spp") for row in STAGES), ("sampling", column))
    return [
        *cells,
        _cell("sampling", column, SAMPLING_MS[spp], ours["sampling"]),
        _cell("total", column, TOTAL_MS[spp], sum(ours.values()), TOTAL_AIM, made_of),
    ]


def _cell(
    row: str, column: str, asked: float, ours: float, aim: float = STAGE_AIM, of: tuple[tuple[str, str], ...] = ()
) -> Cell:
    return Cell(row, column, "ms", published=asked, ours=ours, aim=aim, frame=KILLEROO, of=of)


def _hybrid_cells(ours: dict[str, float], software_ms: float) -> list[Cell]:
    """Cells of the hybrid; its first two stages are those of the software."""
    total = sum(ours.values())
    made_of = (
        ("system overhead", "1 spp"),
        *((row, "hybrid") for row in ("bound and split", "evaluate grid", "sampling")),
    )
    return [
        _cell(
            "bound and split", "hybrid", HYBRID_SPLIT_MS, ours["bound_and_split"], of=(("bound and split", "1 spp"),)
        ),
        _cell("evaluate grid", "hybrid", DICE_MS, ours["dice"], of=(("evaluate grid", "1 spp"),)),
        _cell("sampling", "hybrid", HYBRID_SAMPLING_MS, ours["hardware"]),
        _cell("total", "hybrid", HYBRID_TOTAL_MS, total, TOTAL_AIM, made_of),
        Cell(
            "frames a second",
            "software : hybrid",
            "",
            published=0.48,
            ours=total / software_ms,
            aim=TOTAL_AIM,
            frame=KILLEROO,
            of=(("total", "hybrid"), ("total", "1 spp")),
        ),
    ]


def _draw(stages: dict[str, dict[str, float]], path: Path) -> None:
    table: pd.DataFrame = pd.DataFrame(stages).T.fillna(0.0)
    known = pd.DataFrame(PUBLISHED_MS).T
    stacked_bars(table, path, title="Time of each stage, killeroo on a GTX 280", unit="time [ms]", published=known)
