"""Patches across the eye's plane: bound and split without end (Eisenacher & Loop 2010, section 3.1).

A sub-patch with control points on both sides of the eye's plane has no box on screen, so it is split. Where the surface
passes near the eye that goes on until sub-patches are as small as its distance; where it passes through the eye, for
ever. A queue entry of 8 bytes (ours) ends it after 14 halvings, and what is still large then is dropped: a hole.
"""

from functools import cache
from pathlib import Path

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import Split, draw, flat_patch, milliseconds, split
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import MAX_DEPTH

QUESTION = "When does splitting a patch across the eye's plane not end?"
WIDTH, HEIGHT = 96, 64  # pixels
SIDE = 1.0  # of the floor, around the point below the eye: distances are in patch sides
NEAR = 0.002  # patch sides
DISTANCES = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4, 1e-5)
DEPTHS = (10, 12, MAX_DEPTH)
TOLERANCE = 0.08  # of a boundary, relative
FLOOR = flat_patch([[[-0.5, -0.5, 0], [0.5, -0.5, 0]], [[-0.5, 0.5, 0], [0.5, 0.5, 0]]])


@cache
def frame(distance: float, max_depth: int = MAX_DEPTH, near: float = 0.0) -> Split:
    """Stand ``distance`` above the floor and look ahead and a little down."""
    view = LookAt((0, 0, distance), (1, 0, distance - 0.2), (0, 0, 1), 60.0, 0.001, 5.0)
    return split(FLOOR, view.matrix(WIDTH, HEIGHT), WIDTH, HEIGHT, max_depth=max_depth, near=near)


def breaks_off(distance: float, max_depth: int = MAX_DEPTH, near: float = 0.0) -> bool:
    """Whether sub-patches are dropped at the depth limit."""
    return frame(distance, max_depth, near).given_up > 0


def boundary(max_depth: int = MAX_DEPTH, near: float = 0.0) -> tuple[float | None, float | None]:
    """Distance that holds, and distance that breaks."""
    return bisect(
        lambda distance: breaks_off(distance, max_depth, near), DISTANCES[0], DISTANCES[-1], tolerance=TOLERANCE
    )


def empty_pixels(distance: float, near: float = 0.0) -> int:
    """Pixels without floor: the sky, and holes."""
    return int((draw(frame(distance, near=near).grids, WIDTH, HEIGHT).hits == 0).sum())


def run(progress: Progress) -> Result:
    """Come nearer to the floor, with and without a near limit."""
    found = {}
    for depth in DEPTHS:
        progress(f"stability/eye_plane: at most {depth} halvings")
        found[depth] = boundary(depth)
    rows = pd.DataFrame([_row(distance, near) for near in (0.0, NEAR) for distance in DISTANCES])
    passes = frame(DISTANCES[-1]).subpatches.passes[:, 0]
    holds, breaks = found[MAX_DEPTH]
    with_near = boundary(near=NEAR)
    parameter = "distance of the eye from the surface"
    wrong = "sub-patches across the eye's plane are still large at the depth limit and are dropped"
    boundaries = [
        Boundary(f"micropolygon, at most {depth} halvings", parameter, "patch sides", *found[depth], wrong)
        for depth in DEPTHS[:-1]
    ]
    method = f"micropolygon, at most {MAX_DEPTH} halvings"
    wrong = f"sub-patches are dropped: {_holes(rows)}"
    cure = f"cull sub-patches wholly nearer than {NEAR:g} sides (near)"
    boundaries.append(Boundary(method, parameter, "patch sides", holds, breaks, wrong, cure, _cost(holds)))
    boundaries.append(Boundary(f"micropolygon with near {NEAR:g}", "distance", "patch sides", *with_near, "dropped"))
    table = pd.DataFrame({"pass": range(1, len(passes) + 1), "sub-patches": passes})
    growth = int(passes[-2] - passes[-3])
    notes = [
        f"At distance {DISTANCES[-1]:g} the queue grows by {growth} sub-patches a pass and would go on so for ever.",
        f"A further halving, two bits of an entry, allows {_ratio(found):.2f} times the distance; none allows zero.",
    ]
    figures = [
        Figure("queue", _draw_queue),
        Figure("depth", lambda path: _draw_depth(pd.DataFrame([(d, f[1]) for d, f in found.items()]), path)),
    ]
    tables = {"distances": rows, "queue_at_the_end": table}
    return atlas_result("stability/eye_plane", "Patches across the eye's plane", boundaries, figures, notes, tables)


def _row(distance: float, near: float) -> dict[str, float]:
    made = frame(distance, near=near)
    return {
        "distance": distance,
        "near": near,
        "passes": len(made.subpatches.passes),
        "sub-patches": len(made.subpatches.patch),
        "dropped": made.given_up,
        "empty_pixels": empty_pixels(distance, near),
        "front_end_ms": milliseconds(made.works),
    }


def _holes(rows: pd.DataFrame) -> str:
    """How large the hole is once half the given distance is reached."""
    plain = rows[rows.near == 0]
    sky = int(plain.empty_pixels.min())
    worst = plain.iloc[-1]
    return f"at {worst.distance:g} sides {worst.dropped:.0f} of them, and {worst.empty_pixels - sky:.0f} floor pixels"


def _cost(holds: float | None) -> str:
    """What near costs where nothing is nearer."""
    if holds is None:
        return ""
    plain, cured = (milliseconds(frame(2 * holds, near=near).works) for near in (0.0, NEAR))
    more = 100 * (cured / plain - 1)
    return f"{more:+.1f} % of {plain:.3g} ms at twice the distance; what is nearer than near is lost by intent"


def _ratio(found: dict[int, tuple[float | None, float | None]]) -> float:
    first, last = found[DEPTHS[0]][1], found[DEPTHS[-1]][1]
    if first is None or last is None:
        return float("nan")
    return float((last / first) ** (1 / (DEPTHS[-1] - DEPTHS[0])))


def _draw_queue(path: Path) -> None:
    shown = [d for d in DISTANCES if d in (0.2, 0.02, 0.002, 0.001, 1e-5)]
    rows = [
        {"pass": k + 1, "length": length, "distance": f"{distance:g} sides"}
        for distance in shown
        for k, length in enumerate(frame(distance).subpatches.passes[:, 0])
    ]
    lines(
        pd.DataFrame(rows), path, x="pass", y="length", by="distance",
        title="Bound and split, by the eye's distance from the surface: without end", x_label="pass",
        y_label="sub-patches in the queue",
    )  # fmt: skip


def _draw_depth(table: pd.DataFrame, path: Path) -> None:
    table.columns = ["depth", "distance"]
    lines(
        table.assign(line="first distance at which sub-patches are dropped"), path, x="depth", y="distance", by="line",
        title="How near the eye may come, by the halvings that a queue entry can hold", x_label="halvings at most",
        y_label="distance from the surface [patch sides]", log_y=True,
    )  # fmt: skip
