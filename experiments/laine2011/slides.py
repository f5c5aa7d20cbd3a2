"""Slides: five scenes, three sizes: hardware, CudaRaster and FreePipe on a GTX 480 (Laine & Karras 2011)."""

from collections.abc import Sequence

import pandas as pd

from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Result, reported
from tilestamp.experiments.laine2011.generated import (
    PIPELINES,
    VARIABLE,
    Statistics,
    draw,
    frame_name,
    scenes,
    sizes,
    time_bars,
    warning,
)
from tilestamp.experiments.laine2011.sweep import SOURCE

QUESTION = "How do CudaRaster, FreePipe and the hardware pipe compare on five scenes?"
AIMS = {"hardware": 0.2, "cudaraster": 0.2, "freepipe": 0.3}
SLOW = True  # with what it needs compiled, more than the first run should take


def run(progress: Progress) -> Result:
    """Draw generated scenes by three pipelines."""
    cells: list[Cell] = []
    rows = []
    for scene in scenes():
        for width, height in sizes():
            times = {}
            for pipeline in PIPELINES:
                progress(f"laine2011/slides: {scene.name}, {width}x{height}, {pipeline}")
                times[pipeline] = draw(scene.name, pipeline, width, height).milliseconds
            asked = published_ms(scene.name, width, height)
            cells += time_cells(scene.name, (width, height), times, asked)
            rows += [
                {"pipeline": p, "published": asked[p], "ms": times[p], "scene": scene.name, "width": width}
                for p in PIPELINES
            ]
        cells += statistic_cells(scene)
    table = pd.DataFrame(rows)
    title = "Slides: hardware (HW), CudaRaster (SW) and FreePipe (FP), depth test and colour, GTX 480"
    answer = _answer(cells)
    figures = [
        time_bars("pipelines", lambda cell: cell.column in PIPELINES[:2], "Frame time"),
        time_bars("freepipe", lambda cell: cell.column in PIPELINES[2:], "Frame time"),
    ]
    notes = [
        (
            "Fitted: of each scene the exponent of its areas, to FreePipe at 512x384 (Buddha: 1024x768), and the "
            "set-up of a triangle in FreePipe, to Buddha at 512x384. SW:HW and FP:SW are ratios of times, above 1 "
            "where the first is slower. How triangles crowd about the centre, and Buddha's ellipse, were chosen "
            "with these times in sight: predicted cells followed no fitted number, but were not blind to the form."
        ),
        f"1024x768 without San Miguel, unless {VARIABLE}=all. No triangle count is scaled down.",
    ]
    warnings = [warning()]
    tables = {"times": table}
    return Result(
        "laine2011-slides", title, SOURCE, cells, answer, figures=figures, notes=notes, warnings=warnings, tables=tables
    )


def _answer(cells: Sequence[Cell]) -> str:
    """Ratios of times, from the least to the most."""
    return (
        f"CudaRaster takes {_span(cells, 'SW:HW')} the hardware's time, FreePipe {_span(cells, 'FP:SW')} CudaRaster's."
    )


def _span(cells: Sequence[Cell], column: str) -> str:
    some = [cell for cell in cells if cell.column == column]
    ours, theirs = ([float(getattr(cell, key)) for cell in some] for key in ("ours", "published"))
    return f"{min(ours):.3g} to {max(ours):.3g} times ({min(theirs):.3g} to {max(theirs):.3g} published)"


def published_ms(scene: str, width: int, height: int) -> dict[str, float]:
    """Published times by pipeline."""
    table = published(__file__, "slides-performance").set_index(["scene", "width", "height"])
    return {pipeline: float(table.loc[(scene, width, height), f"{pipeline}_ms"]) for pipeline in PIPELINES}


def time_cells(scene: str, size: tuple[int, int], ours: dict[str, float], asked: dict[str, float]) -> list[Cell]:
    """Times, and the two ratios of the slides."""
    row, frame = f"{scene} {size[0]}x{size[1]}", frame_name(scene, *size)
    cells = [
        Cell(row, pipeline, "ms", published=asked[pipeline], ours=ours[pipeline], aim=aim, frame=frame)
        for pipeline, aim in AIMS.items()
    ]
    for name, slow, fast in (("SW:HW", "cudaraster", "hardware"), ("FP:SW", "freepipe", "cudaraster")):
        ratios = [times[slow] / times[fast] for times in (asked, ours)]
        cells.append(
            Cell(row, name, "", published=ratios[0], ours=ratios[1], frame=frame, of=((row, slow), (row, fast)))
        )
    return cells


def statistic_cells(scene: Statistics) -> list[Cell]:
    """What the generated scene has of what was asked for, at 1024x768."""
    counters = draw(scene.name, "cudaraster", 1024, 768).frame.facts["counters"]
    visible = 100.0 - counters["TriangleSetup / Viewport cull"] - counters["TriangleSetup / Backface cull"]
    survivors = visible - counters["TriangleSetup / Between pixels cull"]
    pixels = counters["TriangleSetup / Avg. samples / tri"] * survivors / visible
    return [
        reported(scene.name, "visible triangles", "%", visible, published=None if scene.assumed else scene.visible),
        reported(scene.name, "pixels a triangle", "", pixels, published=scene.pixels),
    ]
