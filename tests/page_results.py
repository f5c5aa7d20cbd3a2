"""A small folder of results, with everything that a page can show."""

from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from tilestamp.experiments.harness.folder import rebuild
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result
from tilestamp.experiments.harness.write import Making, write_result
from tilestamp.experiments.stability.boundary import Boundary, boundary_table


def write_page_of_everything(folder: Path) -> Path:
    """Write results of a paper, a what-if, a frontier and a boundary; give the page."""
    for result in (paper(), what_if(), frontier(), stability()):
        write_result(result, folder, Making(seconds=1.0))
    return rebuild(folder)[2]


def paper() -> Result:
    """Cells of every status, a long table, a plot, and a sentence for each list."""
    statuses = ("predicted", "partly fitted", "fitted", "stand-in", "reproduced")
    cells = [
        Cell(f"row {n}", "time", "ms", published=2.0**n, ours=2.2 * 1.9**n, status=statuses[n % 5], aim=0.1)
        for n in range(20)
    ]
    cells += [Cell("row 3", "count", "", published=100.0, ours=101.0, aim=0.02)]
    cells += [Cell("a <b>", "order", "", published="4x4 < 8x8", ours="8x8 < 4x4")]
    return Result(
        name="eisenacher2010-table9", experiment="eisenacher2010/table9", title="Table 9: times & counts",
        source="A paper", cells=cells, answer="The STE is 20 %.", figures=[Figure("plot", _plot)],
        notes=["At 4 spp, 1 < 2."], warnings=["STAND-IN for a model"], tables={"more": pd.DataFrame({"a": [1]})},
    )  # fmt: skip


def what_if() -> Result:
    """A picture and its heat map, sliders over a grid, and a map of tiles."""
    values = [(a, b, stage) for a in (0.5, 1.0, 1.5) for b in (1.0, 2.0) for stage in ("bin", "fine")]
    grid = pd.DataFrame(values, columns=["SMs", "clock", "stage"])
    grid["milliseconds"] = (12 / grid.SMs / grid.clock).where(grid.stage == "bin", 4 / grid.clock)
    tiles = pd.DataFrame({"x": [0, 1, 2], "y": [0, 1, 2], "tests": [5, 50, 500]})
    bars = {"sliders": {"SMs": "SMs, times 30", "clock": "clock"}, "bar": "stage", "value": "milliseconds"}
    charts = [
        Chart(name="sliders", kind="sliders", table="grid", title="Pull", alt="Bars with sliders",
              of={**bars, "color": "stage", "unit": "ms"}),
        Chart(name="tiles", kind="tiles", table="tiles", title="Tiles", alt="Map of tiles",
              of={"x": "x", "y": "y", "value": "tests", "size": [4, 3]}),
    ]  # fmt: skip
    return Result(
        name="studies_shipped-what_if", experiment="studies_shipped/what_if", title="One frame", source="Ours",
        cells=[Cell("as it was", "frame", "ms", published=None, ours=16.0, status="reported")], charts=charts,
        answer="The frame takes 16 ms.", tables={"grid": grid, "tiles": tiles},
        figures=[Figure("picture", _plot), Figure("heat-map", _plot)],
    )  # fmt: skip


def frontier() -> Result:
    """Cost against error with a list to choose from, and lines."""
    points = pd.DataFrame({
        "method": ["a", "b", "c"] * 2, "scene": ["small"] * 3 + ["large"] * 3, "ms": [1.0, 2.0, 3.0, 2.0, 4.0, 6.0],
        "flip": [0.3, 0.1, 0.2, 0.4, 0.0, 0.3], "front": [True, True, False] * 2,
    })  # fmt: skip
    shared = {"x": "ms", "y": "flip", "color": "method", "titles": ["ms", "FLIP"], "pick": {"scene": "Scene"}}
    charts = [
        Chart(name="front", kind="front", table="points", title="Front", alt="Time against error",
              of={**shared, "label": "method", "front": "front"}),
        Chart(name="lines", kind="lines", table="points", title="Lines", alt="Lines", of={**shared, "log": False}),
    ]  # fmt: skip
    return Result(
        name="frontier-methods", experiment="frontier/methods", title="Methods", source="Ours", charts=charts,
        cells=[Cell("best", "time", "ms", published=None, ours=1.0, status="reported")], tables={"points": points},
        figures=[Figure("one", _plot), Figure("two", _plot)],
    )  # fmt: skip


def stability() -> Result:
    """A boundary that breaks, and one that never does."""
    rows = [
        Boundary("tiled", "layers", "", 64, None, "nothing"),
        Boundary("freepipe", "layers", "", None, 2, "it shows", "a cure", "2 ms"),
    ]
    return Result(
        name="stability-races", experiment="stability/races", title="Races", source="Ours",
        cells=[Cell("freepipe", "layers breaks at", "", published=None, ours=2.0, status="reported")],
        tables={"boundaries": boundary_table(rows)},
    )  # fmt: skip


def _plot(path: Path) -> None:
    Image.fromarray(np.full((60, 80, 3), 128, np.uint8)).save(path.with_suffix(".png"))
