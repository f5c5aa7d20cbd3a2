"""Where software meets hardware: CudaRaster against the fixed-function pipe over the size of triangles."""

from functools import partial

import pandas as pd

from tilestamp.experiments.frontier.methods_scenes import sheets
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.questions.best import Boundary, boundaries
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies_shipped.finding import finding, table_of
from tilestamp.reports.plots import lines

QUESTION = "For which sizes of triangles is software as fast as hardware?"
SLOW = True  # runs when it is named: tilestamp reproduce studies
MACHINES = ("gtx480", "gtx680", "gtx1080", "rtx2080ti", "rtx4090", "h200")
AREAS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)  # pixels a triangle
WIDTH, HEIGHT = 640, 480
SOFTWARE, HARDWARE = "cudaraster", "hardware"


def run(progress: Progress) -> Result:
    """Price both on each machine, at each size."""
    scenes = {f"{area:g}": {"scene": sheets(area, WIDTH, HEIGHT)} for area in AREAS}
    study = Study(
        title="software or hardware",
        fixed={"size": f"{WIDTH}x{HEIGHT}"},
        grid={"area": scenes, "pipeline": [SOFTWARE, HARDWARE], "machine": list(MACHINES)},
    )
    table = table_of(study, progress)
    table = table.assign(area=table["area"].astype(float))
    crossings = boundaries(table, "pipeline", "area", ["machine"])
    ratios = ratio_table(table)
    cells = [
        reported(str(machine), f"{row.area:g} px: software / hardware", "", row.ratio)
        for machine, rows in ratios.groupby("machine", sort=False)
        for row in rows.itertuples()
    ]
    figure = Figure("ratio", partial(
        lines, ratios, x="area", y="ratio", by="machine", log_x=True, log_y=True,
        title="CudaRaster against fixed function: below 1 software is faster", x_label="area of a triangle [pixels]",
        y_label="time of software / of hardware",
    ))  # fmt: skip
    title = (
        f"Where software meets hardware: CudaRaster against fixed function, two sheets of triangles, {WIDTH}x{HEIGHT}"
    )
    return finding("software_or_hardware", title, cells, [figure], notes(ratios, crossings), {"times": table})


def ratio_table(table: pd.DataFrame) -> pd.DataFrame:
    """Time of software over that of hardware, a row a machine and size."""
    times = table.pivot_table("milliseconds", ["machine", "area"], "pipeline", sort=False)
    return (times[SOFTWARE] / times[HARDWARE]).rename("ratio").reset_index()


def notes(ratios: pd.DataFrame, crossings: list[Boundary]) -> list[str]:
    """Say where they cross on each machine, and how far apart they are at both ends."""
    return [
        *(_machine(str(machine), rows, crossings) for machine, rows in ratios.groupby("machine", sort=False)),
        _closest(ratios),
        "Most rates of the fixed-function pipes are assumed: the machine files say which.",
    ]


def _machine(machine: str, rows: pd.DataFrame, crossings: list[Boundary]) -> str:
    ends = rows.sort_values("area").iloc[[0, -1]]
    told = ", ".join(f"{row.ratio:.2g} times at {row.area:g} px" for row in ends.itertuples())
    mine = [cross for cross in crossings if cross.place["machine"] == machine]
    where = "; ".join(f"{one.before} is faster up to {one.at:.3g} pixels a triangle, then {one.after}" for one in mine)
    always = SOFTWARE if ends["ratio"].iloc[0] < 1 else HARDWARE
    return f"{machine}: {where or f'{always} is faster at every size'} (software takes {told} what hardware takes)."


def _closest(ratios: pd.DataFrame) -> str:
    row = ratios.loc[ratios["ratio"].idxmin()]
    return (
        f"Software comes closest on {row['machine']} at {row['area']:g} px: fixed function at"
        f" {1 / row['ratio']:.2g} of its rates would be as fast."
    )
