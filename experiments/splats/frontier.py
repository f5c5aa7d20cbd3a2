"""Modelled time against picture error of splats: list rules, tiles, order, levels of detail, half precision.

The truth is the finest level that is here, blended at each pixel in the order of that pixel, in double precision
(``simulator/reference/splats.py``); so order by centres, the early stop, squares that cut, rounding and missing detail
are all errors. Half precision rounds conics, opacities and colours to 16 bits; its time is taken to be that of floats,
since the loads of the blending loop are not what it waits for.

Stochastic transparency, which needs no order, is told by its error alone: no time is modelled for it.

Without levels on the scene search path the embedded one is all there is, and no error of detail is told.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.splats.host import frame_ms
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.reports.methods_plot import panels
from tilestamp.simulator.reference.splats import composed, stochastic
from tilestamp.simulator.reference.splats import in_order as fragments_in_order
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.pinhole import Pinhole, PinholeCamera, pinhole_camera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.kerbl2023.blend import blend
from tilestamp.simulator.stages.kerbl2023.harmonics import colours_seen
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.tiles import tiles_of

QUESTION = "What does an exact picture of splats cost, and which error buys how much time?"
MACHINE = "h200"
WIDTH, HEIGHT = 480, 360
EMBEDDED = "playbot"
LEVELS = ("playbot/3", "playbot/4", "playbot/5", "playbot/6")  # 31,000 to 1,873 Gaussians
RULES, TILES = ("square", "box", "ellipse"), (8, 16, 32)
WINDOWS = {8: (4, 16), 16: (4, 16)}  # of pixels that sort, by tile; 1,024 threads have no registers for windows
SAMPLES = (1, 4, 16)  # a pixel, by chance
STEP = 255.0  # of a byte


def run(progress: Progress) -> Result:
    """Draw each level by each rule and tile."""
    scenes = levels()
    finest = next(iter(scenes.values()))
    camera = pinhole_camera(finest.views["default"], WIDTH, HEIGHT)
    progress("splats/frontier: the truth")
    exact = truth(finest, camera)
    rows = []
    for name, scene in scenes.items():
        progress(f"splats/frontier: {name}")
        rows += [row for rule in RULES for tile in TILES for row in points(name, scene, camera, exact, rule, tile)]
        rows += [in_order(name, scene, camera, exact, tile, window) for tile in WINDOWS for window in WINDOWS[tile]]
    progress("splats/frontier: samples by chance")
    chance = pd.DataFrame(by_chance(finest, camera, exact))
    table = pd.DataFrame(rows)
    table["front"] = pareto_front(table["ms"], table["rms"])
    title = f"Splats: modelled time on the {MACHINE} against error, {WIDTH}x{HEIGHT}"
    cells = [
        reported(f"{row['level']}, {row['rule']}, {row['tile']}x{row['tile']}", name, unit, float(row[column]))
        for row in rows
        for name, unit, column in (("frame", "ms", "ms"), ("error", "steps of a byte", "rms"))
    ]
    figures = [Figure("frontier", partial(_draw, table, title))]
    tables = {"points": table, "stochastic": chance}
    return finding("frontier", title, cells, figures, notes(table, chance), tables, _missing(scenes), folder="splats")


def levels() -> dict[str, Scene]:
    """Levels of detail that are here, the finest first; the embedded one where there are none."""
    found = {}
    for name in LEVELS:
        try:
            found[name] = load_scene(name)
        except TilestampError:
            continue
    return found or {EMBEDDED: load_scene(EMBEDDED)}


def truth(scene: Scene, camera: Pinhole) -> NDArray[np.float64]:
    """The picture as it is meant."""
    made, splats = drawn(scene, camera), scene.splats
    assert splats is not None  # noqa: S101 - one of splats
    return composed(splats, colours_seen(splats, camera), projected(made), camera, WIDTH, HEIGHT)


def by_chance(scene: Scene, camera: Pinhole, exact: NDArray[np.float64]) -> list[dict[str, float]]:
    """Error of stochastic transparency by samples a pixel."""
    assert scene.splats is not None  # noqa: S101 - one of splats
    colours, on_screen = colours_seen(scene.splats, camera), projected(drawn(scene, camera))
    found = fragments_in_order(scene.splats, on_screen, camera, WIDTH, HEIGHT)
    return [
        {"samples": samples, "rms": error(stochastic(found, colours, WIDTH, HEIGHT, samples), exact)}
        for samples in SAMPLES
    ]


def drawn(scene: Scene, camera: Pinhole, **options: Any) -> Run:
    """One frame."""
    return simulate(scene, "splat", MACHINE, width=WIDTH, height=HEIGHT, camera=PinholeCamera(camera), **options)


def projected(made: Run) -> Projected:
    """Gaussians on the screen, as the frame has them."""
    return Projected(**{name: made.frame.buffers[name] for name in Projected._fields})


def points(
    level: str, scene: Scene, camera: Pinhole, exact: NDArray[np.float64], rule: str, tile: int
) -> list[dict[str, Any]]:
    """Time and error of one frame in the order of centres, with floats and with half precision."""
    made, masked = (drawn(scene, camera, bound=rule, tile=tile, mask=mask) for mask in (False, True))
    return [
        {"level": level, "rule": f"{rule}, mask", "order": "centres", "window": 0, "precision": "float"}
        | point(masked, exact, tile),
        {"level": level, "rule": rule, "order": "centres", "window": 0, "precision": "float"}
        | point(made, exact, tile),
        {"level": level, "rule": f"{rule}, half", "order": "centres", "window": 0, "precision": "half"}
        | point(made, exact, tile, halved(made, scene, camera, tile)),
    ]


def in_order(
    level: str, scene: Scene, camera: Pinhole, exact: NDArray[np.float64], tile: int, window: int
) -> dict[str, Any]:
    """Time and error of one frame that sorts at each pixel."""
    made = drawn(scene, camera, bound="ellipse", tile=tile, order="pixel", window=window)
    place = {"level": level, "rule": f"ellipse, window {window}", "order": "pixel", "window": window}
    return place | {"precision": "float"} | point(made, exact, tile)


def point(
    made: Run, exact: NDArray[np.float64], tile: int, picture: NDArray[np.float32] | None = None
) -> dict[str, Any]:
    """Time and error of a picture: of the frame, or of another one."""
    picture = made.frame.buffers["colours"] if picture is None else picture
    return {
        "tile": tile, "Gaussians": len(made.frame.buffers["radii"]), "ms": frame_ms(made),
        "blend_ms": float(made.stages.milliseconds["blend"]), "rms": error(picture, exact),
        "worst": STEP * float(np.abs(picture - exact).max()), "early": made.counts.get("blend.EARLY", 0),
    }  # fmt: skip


def halved(made: Run, scene: Scene, camera: Pinhole, tile: int) -> NDArray[np.float32]:
    """The picture of the same lists with conics, opacities and colours rounded to 16 bits."""
    assert scene.splats is not None  # noqa: S101 - one of splats
    on_screen, colours = projected(made), colours_seen(scene.splats, camera)
    rounded = on_screen._replace(conics=half(on_screen.conics))
    buffers, tiles = made.frame.buffers, tiles_of(WIDTH, HEIGHT, tile, tile)
    inputs = (buffers["starts"], buffers["listed"], rounded, half(colours), tiles, Simt())
    return blend(*inputs, threads=tile * tile, counting=False).outputs.colours


def half(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to 16 bits."""
    return values.astype(np.float16).astype(np.float32)


def error(picture: NDArray[np.floating], exact: NDArray[np.float64]) -> float:
    """Root mean square of all channels, in steps of a byte."""
    return STEP * float(np.sqrt(np.mean((picture - exact) ** 2)))


def notes(table: pd.DataFrame, chance: pd.DataFrame) -> list[str]:
    """Answer first."""
    finest = table[table["level"] == table["level"].iloc[0]]
    plain = finest[(finest["order"] == "centres") & (finest["precision"] == "float")]
    fast = plain.loc[plain["ms"].idxmin()]
    own = finest[finest["order"] == "pixel"]
    best = own.loc[own["rms"].idxmin()]
    answer = (
        f"In the order of centres every list rule and tile of the finest level is {plain['rms'].min():.2f} to "
        f"{plain['rms'].max():.2f} steps of a byte off (root mean square), so the choice among them is one of time: "
        f"{fast['rule']} lists of {fast['tile']}x{fast['tile']} take {fast['ms']:.3f} ms. The order is the error: a "
        f"window of {best['window']} at each pixel, tiles of {best['tile']}, is {best['rms']:.2f} off in "
        f"{best['ms']:.3f} ms, its blending {best['blend_ms'] / fast['blend_ms']:.1f} times as long."
    )
    halves = finest[finest["order"] == "centres"].groupby("precision")["rms"].mean()
    half = f"Half precision of conics, opacities and colours: {halves['float']:.3f} becomes {halves['half']:.3f} steps."
    told = ", ".join(f"{row['rms']:.1f} with {row['samples']:.0f}" for row in chance.to_dict("records"))
    random = f"Stochastic transparency, unsorted, is further off: {told} samples a pixel; its time is not modelled."
    return [answer, half, random, *_coarser(table), SURE]


SURE = (
    "Assumed: what sorting at a pixel and masks cost (by hand from their statements); all else is priced as measured."
)


def _coarser(table: pd.DataFrame) -> list[str]:
    """What each level of detail buys."""
    best = (
        table[(table["precision"] == "float") & (table["order"] == "centres")]
        .sort_values("ms")
        .groupby("level", sort=False)
        .first()
    )
    return [
        f"{level}, {row['Gaussians']:,} Gaussians: {row['rms']:.2f} steps off in {row['ms']:.3f} ms at best."
        for level, row in best.sort_values("Gaussians", ascending=False).iterrows()
    ]


def _missing(scenes: dict[str, Scene]) -> list[str]:
    missing = [name for name in LEVELS if name not in scenes]
    return [f"levels of detail that are not on the scene search path: {', '.join(missing)}"] if missing else []


def _draw(table: pd.DataFrame, title: str, path: Path) -> None:
    kind = [rule.partition(", ")[2] or rule for rule in table["rule"]]
    panels(
        table.assign(kind=kind), path, panel="level", group="kind", x="ms", y="rms", fronts=["front"],
        x_label="modelled frame [ms]", y_label="error [steps of a byte, RMS]", title=title,
    )  # fmt: skip
