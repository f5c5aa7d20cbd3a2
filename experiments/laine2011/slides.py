"""Slides: five scenes, three sizes: hardware, CudaRaster and FreePipe on a GTX 480 (Laine & Karras 2011)."""

from typing import TYPE_CHECKING

from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.experiments.laine2011.generated import PIPELINES, VARIABLE, draw, scenes, sizes, warning
from tilestamp.experiments.laine2011.sweep import SOURCE
from tilestamp.reports.plots import paired_bars

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from tilestamp.experiments.laine2011.generated import Statistics

SLOW = True  # with what it needs compiled, more than the first run should take


def run(progress: Progress) -> Result:
    """Draw generated scenes by three pipelines."""
    import pandas as pd

    cells: list[Cell] = []
    rows = []
    for scene in scenes():
        for width, height in sizes():
            times = {}
            for pipeline in PIPELINES:
                progress(f"laine2011/slides: {scene.name}, {width}x{height}, {pipeline}")
                times[pipeline] = draw(scene.name, pipeline, width, height).milliseconds
            asked = published_ms(scene.name, width, height)
            cells += time_cells(f"{scene.name} {width}x{height}", times, asked)
            rows += [
                {"pipeline": p, "published": asked[p], "ms": times[p], "scene": scene.name, "width": width}
                for p in PIPELINES
            ]
        cells += statistic_cells(scene)
    table = pd.DataFrame(rows)
    return Result(
        name="laine2011-slides",
        title="Slides: hardware (HW), CudaRaster (SW) and FreePipe (FP), depth test and colour, GTX 480",
        source=SOURCE,
        cells=cells,
        figures=[
            Figure("pipelines", lambda path: _draw(table, PIPELINES[:2], path)),
            Figure("freepipe", lambda path: _draw(table, PIPELINES[2:], path)),
        ],
        notes=[
            (
                "Nothing is fitted to these cells. SW:HW and FP:SW are ratios of times, above 1 where the first is "
                "slower."
            ),
            f"1024x768 without San Miguel, unless {VARIABLE}=all. No triangle count is scaled down.",
        ],
        warnings=[warning()],
        tables={"times": table},
    )


def published_ms(scene: str, width: int, height: int) -> dict[str, float]:
    """Published times by pipeline."""
    table = published(__file__, "slides-performance").set_index(["scene", "width", "height"])
    return {pipeline: float(table.loc[(scene, width, height), f"{pipeline}_ms"]) for pipeline in PIPELINES}


def time_cells(row: str, ours: dict[str, float], asked: dict[str, float]) -> list[Cell]:
    """Times, and the two ratios of the slides."""
    cells = [
        Cell(row, pipeline, "ms", published=asked[pipeline], ours=ours[pipeline], status="reported")
        for pipeline in PIPELINES
    ]
    for name, slow, fast in (("SW:HW", "cudaraster", "hardware"), ("FP:SW", "freepipe", "cudaraster")):
        cells.append(
            Cell(row, name, "", published=asked[slow] / asked[fast], ours=ours[slow] / ours[fast], status="reported")
        )
    return cells


def statistic_cells(scene: "Statistics") -> list[Cell]:
    """What the generated scene has of what was asked for, at 1024x768."""
    counts = draw(scene.name, "cudaraster", 1024, 768).counts
    visible = counts["triangle_setup.TRIANGLE_LANES"] - counts["triangle_setup.BACKFACE_CULLED"]
    visible -= counts["triangle_setup.VIEWPORT_CULLED"]
    fragments = draw(scene.name, "freepipe", 1024, 768).frame.facts["fragments"]
    share = 100.0 * visible / scene.triangles
    pixels = fragments / scene.triangles  # both faces, and all of them drawn
    return [
        Cell(
            scene.name,
            "visible triangles",
            "%",
            published=None if scene.assumed else scene.visible,
            ours=share,
            status="reported",
        ),
        Cell(scene.name, "pixels a triangle", "", published=scene.pixels, ours=pixels, status="reported"),
    ]


def _draw(table: "pd.DataFrame", pipelines: tuple[str, ...], path: "Path") -> None:
    shown = table[table["pipeline"].isin(pipelines)].assign(status="predicted")
    named = shown.assign(cell=shown["scene"] + " " + shown["width"].astype(str) + " " + shown["pipeline"])
    paired_bars(
        named,
        path,
        label="cell",
        ours="ms",
        published="published",
        status="status",
        title="Frame time on generated scenes, GTX 480 (published: on the real ones)",
        y_label="time of a frame [ms]",
    )
