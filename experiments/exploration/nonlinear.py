"""Pictures that bend straight edges: a line of sight a sample against tessellation until straight lines will do."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result, reported
from tilestamp.reports.frontier_plot import frontier
from tilestamp.reports.picture import picture
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.camera import ModelToClip
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "What does a fisheye cost with a line of sight a sample, and what by tessellation that errs as little?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
SOURCE = "tilestamp's own runs: Laine & Karras 2011 name non-linear rasterization, and nothing is published of its cost"
MACHINE, WIDTH, HEIGHT = "h200", 320, 240
VIEWS = {"fisheye": 180.0, "paraboloid": 220.0, "cylindrical": 270.0}  # degrees across
SIDES = (1, 4, 16, 48)  # squares along each wall
TOLERANCES = (16.0, 4.0, 1.0, 0.25)  # pixels
EYE = ModelToClip(np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, -1.0, -0.02], [0, 0, -1.0, 0]]))  # looks along -z
JITTER = 0.25  # of a square: how far the inner corners of a wall are moved along it
LINES = "lines of sight"


def room(side: int, seed: int = 5) -> Scene:
    """Make a closed room around the eye, of side x side squares a wall, two triangles each; its walls are uneven."""
    rng = np.random.default_rng(seed)
    grid = np.linspace(-1.0, 1.0, side + 1)
    walls = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.meshgrid(grid, grid, indexing="ij")
            inner = (np.abs(u) < 1) & (np.abs(v) < 1)
            u, v = (at + inner * rng.uniform(-JITTER, JITTER, at.shape) * 2 / side for at in (u, v))
            walls.append(np.insert(np.stack([u, v], axis=-1).reshape(-1, 2), axis, sign, axis=1))
    points = np.concatenate(walls) * [1.3, 0.9, 1.1] + [0.2, -0.1, 0.3]
    i, j = (at.ravel() for at in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    a = i * (side + 1) + j
    b, c, d = a + 1, a + side + 1, a + side + 2
    wall = np.stack([a, d, c, a, b, d], axis=1).reshape(-1, 3)
    triangles = np.concatenate([wall + n * (side + 1) ** 2 for n in range(6)]).astype(np.int32)
    positions = np.concatenate([points, np.ones((len(points), 1))], axis=1).astype(np.float32)
    return Scene(f"room of {len(triangles)} triangles", mesh=Mesh(positions, triangles), views={"default": EYE})


def draw(kind: str, side: int, **options: Any) -> Run:
    """Draw a room by one method."""
    return simulate(
        room(side), "nonlinear", MACHINE, width=WIDTH, height=HEIGHT, projection=kind, fov=VIEWS[kind], **options
    )


def run(progress: Progress) -> Result:
    """Draw each projection and size of triangle by lines of sight, in both precisions, and by tessellation."""
    rows, pictures = [], {}
    for kind in VIEWS:
        for side in SIDES:
            progress(f"{kind}, walls of {side}x{side}")
            right = draw(kind, side)
            ids = right.triangle_ids
            if side == SIDES[min(1, len(SIDES) - 1)]:
                pictures[kind] = right.image
            row = {"kind": kind, "side": side, "triangles": 12 * side**2}
            rows.append(row | _row(LINES, draw(kind, side, double=False), ids))
            for tolerance in TOLERANCES:
                drawn = draw(kind, side, method="tessellated", tolerance=tolerance, double=False)
                rows.append(row | _row(f"chords within {tolerance:g} px", drawn, ids))
    table = pd.DataFrame(rows)
    title = "Non-linear projections: a line of sight a sample against tessellation"
    cells = _cells(table)
    answer = _answer(table)
    figures = _figures(table, pictures)
    notes = _notes(table)
    tables = {"runs": table}
    return Result("exploration-nonlinear", title, SOURCE, cells, answer, figures=figures, notes=notes, tables=tables)


def _row(method: str, drawn: Run, right: NDArray[np.int32] | None) -> dict[str, Any]:
    tests, hits = (int(drawn.stages[column].sum()) for column in ("sample_tests", "sample_hits"))
    return {
        "method": method, "ms": drawn.milliseconds, "wrong": float(np.mean(drawn.triangle_ids != right)),
        "ste": 100 * hits / tests, "drawn": drawn.frame.facts["micropolygons"],
        "lists": drawn.stages.milliseconds["moving_lists"], "raster": drawn.stages.milliseconds["sample_raster"],
    }  # fmt: skip


def _cells(table: pd.DataFrame) -> list[Cell]:
    return [
        reported(f"{r['kind']}, {r['triangles']} triangles, {r['method']}", column, unit, r[column])
        for r in table.to_dict("records")
        for column, unit in (("ms", "ms"), ("wrong", "share of pixels"))
    ]  # fmt: skip


def _answer(table: pd.DataFrame) -> str:
    """Time of the finest chords over that of lines of sight, and what is wrong still."""
    finest = table[table.method == f"chords within {min(TOLERANCES):g} px"].set_index(["kind", "triangles"])
    sight = table[table.method == LINES].set_index(["kind", "triangles"])
    ratio = (finest.ms / sight.ms).groupby("triangles")
    said = ", ".join(f"{n} triangles {low:.2g} to {high:.2g}" for n, low, high in zip(
        ratio.min().index, ratio.min(), ratio.max(), strict=True))  # fmt: skip
    return (
        f"Time of tessellation within {min(TOLERANCES):g} pixel over that of lines of sight, over the projections:"
        f" {said}; it shows {100 * finest.wrong.min():.2g} to {100 * finest.wrong.max():.2g} % of the pixels wrong,"
        f" lines of sight in float32 at most {100 * sight.wrong.max():.2g} %."
    )


def _notes(table: pd.DataFrame) -> list[str]:
    large = table[table.side == min(SIDES)]
    worst = large[large.method == f"chords within {max(TOLERANCES):g} px"].set_index("kind").wrong
    sight = table[table.method == LINES].set_index(["kind", "side"])
    share = (sight.lists / sight.ms).groupby("side").mean()
    return [
        (
            f"Rooms of {large.triangles.iloc[0]} triangles, chords within {max(TOLERANCES):g} pixels: wrong pixels "
            + ", ".join(f"{kind} {100 * share:.2g} %" for kind, share in worst.items())
            + "."
        ),
        (
            "Lines of sight spend on bounds, of their time: "
            + ", ".join(f"{100 * part:.0f} % at {12 * int(str(side)) ** 2} triangles" for side, part in share.items())
            + "; every triangle looks at every bin, because a cone has no box on a bent screen."
        ),
        (
            "Sure: pictures and counts; in float64 each sample is that of a line of sight in fractions (tests)."
            " Not sure: times; lists and tessellation are counted by hand, and nothing was measured."
        ),
    ]


def _figures(table: pd.DataFrame, pictures: dict[str, NDArray[np.uint8]]) -> list[Figure]:
    made = []
    for kind, image in pictures.items():
        rows = table[table.kind == kind]
        points = rows.assign(
            name=rows.triangles.map("{} triangles".format), group=rows.method, cost=rows.ms, error=rows.wrong,
            published=False,
        )  # fmt: skip
        front = np.concatenate(
            [pareto_front(part.cost, part.error) for _, part in points.groupby("triangles", sort=False)]
        )
        shown = points[points.triangles == points.triangles.iloc[0]].assign(front=front[: 1 + len(TOLERANCES)])
        made += [
            Figure(
                f"picture-{kind}",
                lambda path, kind=kind, image=image: picture(  # type: ignore[misc]
                    image, path, title=f"{kind.capitalize()}, {VIEWS[kind]:g} degrees across, by lines of sight"
                ),
            ),
            Figure(
                f"time-{kind}",
                lambda path, kind=kind, rows=rows: lines(  # type: ignore[misc]
                    rows, path, x="triangles", y="ms", by="method", title=f"Modelled time of a frame, {kind}",
                    x_label="triangles of the room", y_label="time [ms]", log_x=True, log_y=True,
                ),
            ),
            Figure(
                f"frontier-{kind}",
                lambda path, kind=kind, shown=shown: frontier(  # type: ignore[misc]
                    path, shown, "modelled time [ms]", "share of wrong pixels",
                    f"Time against error, {kind}, a room of {shown.triangles.iloc[0]} triangles",
                ),
            ),
        ]  # fmt: skip
    return made
