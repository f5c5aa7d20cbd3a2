"""Decoupled sampling: shades a pixel against the size of the cache, with motion blur and defocus, and what rates do."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.exploration.quad_merging import mesh
from tilestamp.experiments.frontier.picture_error import flip
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.machine import load_machine
from tilestamp.reports.methods_plot import side_by_side
from tilestamp.reports.plots import lines
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, moved, stratified_pattern
from tilestamp.simulator.stages.ragankelley2011.decoupled_shading import (
    DecoupledEvent,
    ShadedSamples,
    Shading,
    decoupled_shading,
)

QUESTION = "How many shades a pixel do motion blur and defocus need, and how large a cache?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
MACHINE = "h200"
SIDE = 48  # pixels
SAMPLES = 16  # a pixel
BLURS = (0.0, 4.0, 16.0)  # pixels of motion; the circle of confusion has an eighth of them as radius
AREAS = (10.0, 100.0, 1000.0)  # pixels a triangle
CACHES = (1, 4, 16, 64, 256, 1024)  # cells
RATES = (0.25, 0.5, 1.0, 2.0)  # cells along a pixel
SHOWN_AREA, SHOWN_BLUR, ENOUGH = 100.0, 16.0, 1024
SQUARE, TURN = 5.3, 0.4  # pixels of the pattern that the shader of the picture draws, and its slope
FRAME: dict[str, Any] = {"width": 96, "height": 72, "edge": 8.0, "spp": 4, "motion": 8.0, "lens": 8.0}
SURE = (
    "Sure: the counts, which a dictionary in order of use gives as well, for polygons in input order and a cache for"
    " every 256 of them. Not sure: prices, which are counted by hand; the published figures were not at hand."
)


def shade(area: float, blur: float, shading: Shading) -> tuple[float, ShadedSamples, NDArray[np.bool_]]:
    """Shades a pixel of a mesh that moves; where samples are shaded, and which are covered."""
    moving, pattern = moved(mesh(area, SIDE), (blur, 0.0), blur / 8), stratified_pattern(SAMPLES)
    samples = blur_samples(SIDE, SIDE, pattern)
    outputs, (work,), _ = decoupled_shading(moving, pattern, samples, shading, load_machine(MACHINE).simt)
    return work.total(DecoupledEvent.SHADES) / SIDE**2, outputs, samples.polygon >= 0


def run(progress: Progress) -> Result:
    """Sweep cache, blur, area and rate."""
    rows = []
    for area in AREAS:
        for blur in BLURS:
            progress(f"triangles of {area:g} pixels, {blur:g} pixels of motion")
            kinds = [(ENOUGH, False), *((n, True) for n in CACHES)]
            rows += [
                {
                    "area": area, "blur": blur, "cache": n, "way": "decoupled" if decoupled else "pixel",
                    "shades": shade(area, blur, Shading(1.0, n, decoupled))[0],
                }
                for n, decoupled in kinds
            ]  # fmt: skip
    table = pd.DataFrame(rows)
    progress("rates")
    rates = pd.DataFrame([_rate(rate) for rate in RATES])
    progress("a model's frame")
    frames = _frames()
    cells = [
        reported(
            f"{r['area']:g} px, {r['blur']:g} px of motion", f"{r['way']}, cache of {r['cache']}", "shades/pixel",
            r["shades"],
        )
        for r in table.to_dict("records")
    ] + [
        reported(f"rate {r['rate']:g}", name, unit, r[key])
        for r in rates.to_dict("records")
        for key, name, unit in (("shades", "shades", "shades/pixel"), ("flip", "FLIP from shading every sample", ""))
    ]  # fmt: skip
    return finding(
        "decoupled", f"Decoupled sampling: shades a pixel at {SAMPLES} samples", cells, _figures(table, rates),
        _notes(table, rates, frames), {"caches": table, "rates": rates, "frames": frames}, folder="exploration",
    )  # fmt: skip


def _shader(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """A pattern fixed to the surface: squares with a slope of light over them."""
    turned = np.stack([points[..., 0] + TURN * points[..., 1], points[..., 1] - TURN * points[..., 0]], axis=-1)
    across = np.floor(turned / SQUARE).sum(axis=-1) % 2
    light: NDArray[np.float64] = (0.25 + 0.5 * across) * (0.8 + 0.4 * points[..., 1] / SIDE)
    return np.stack([light, 0.9 * light, 0.7 * light + 0.1], axis=-1)


def _pictures(rate: float) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Shades a pixel, the picture of samples shaded each for itself, and that of cells shaded at their middle."""
    shades, made, covered = shade(SHOWN_AREA, SHOWN_BLUR, Shading(rate, ENOUGH, decoupled=True))
    middle = ((made.cell + 0.5) / rate).astype(np.float64)
    exact, ours = (
        np.round(255 * (_shader(points) * covered[:, None]).reshape(SIDE, SIDE, SAMPLES, 3).mean(axis=2)) / 255
        for points in (made.point, middle)
    )
    return shades, exact, ours


def _rate(rate: float) -> dict[str, float]:
    shades, exact, ours = _pictures(rate)
    return {"rate": rate, "shades": shades, "flip": flip(exact, np.round(255 * ours).astype(np.uint8))}


def _frames() -> pd.DataFrame:
    """Time of the teapot's frame by how it is shaded."""
    ways: dict[str, dict[str, Any]] = {"not shaded": {}, "decoupled": {"shade_cache": 64}}
    ways["by pixel"] = {"shade_cache": 64, "decoupled": False}
    runs = {name: simulate("teapot", "interval", MACHINE, **FRAME, **options) for name, options in ways.items()}
    return pd.DataFrame(
        {"way": name, "ms": run.milliseconds, "shades": run.counts.get("decoupled_shading.SHADES", 0)}
        for name, run in runs.items()
    )


def _notes(table: pd.DataFrame, rates: pd.DataFrame, frames: pd.DataFrame) -> list[str]:
    at = table.set_index(["way", "area", "blur", "cache"]).shades
    ours, theirs = (at[way, SHOWN_AREA, SHOWN_BLUR, ENOUGH] for way in ("decoupled", "pixel"))
    ms, shades = (frames.set_index("way")[column] for column in ("ms", "shades"))
    sharp = rates.set_index("rate")
    needs = []
    for area in AREAS:
        curve = at.xs(("decoupled", area, SHOWN_BLUR), level=("way", "area", "blur"))
        needs.append(f"{curve[curve <= 1.1 * curve.min()].index.min()} at {area:g} pixels")
    return [
        (
            f"At {SAMPLES} samples, {SHOWN_BLUR:g} pixels of motion and triangles of {SHOWN_AREA:g} pixels decoupled"
            f" sampling shades {ours:.2f} times a pixel, multisampling {theirs:.2f} times; at rest both shade"
            f" {at['pixel', SHOWN_AREA, 0.0, ENOUGH]:.2f} times."
        ),
        f"Cells within a tenth of the fewest shades, by area of a triangle: {', '.join(needs)}.",
        (
            f"A shade for every two pixels each way costs {sharp.shades[0.5]:.2f} shades a pixel and a FLIP error of"
            f" {sharp.flip[0.5]:.3f} from shading every sample, one a pixel {sharp.shades[1.0]:.2f} and"
            f" {sharp.flip[1.0]:.3f}, four {sharp.shades[2.0]:.2f} and {sharp.flip[2.0]:.3f}."
        ),
        (
            f"The teapot at 4 samples, 8 pixels of motion and circles of 8, on the {MACHINE}: {ms['not shaded']:.3f} ms"
            f" not shaded, {ms['decoupled']:.3f} decoupled with {shades['decoupled']:,} shades, {ms['by pixel']:.3f} by"
            f" pixel with {shades['by pixel']:,}, with a shader of 66 instructions."
        ),
        SURE,
    ]


def _figures(table: pd.DataFrame, rates: pd.DataFrame) -> list[Figure]:
    decoupled = table[table.way == "decoupled"]
    shown = decoupled[decoupled.blur == SHOWN_BLUR].assign(line=decoupled.area.map("{:g} px a triangle".format))
    flat = table[(table.way == "pixel") & (table.blur == SHOWN_BLUR)]
    flat = pd.concat(
        flat.assign(cache=n, line=flat.area.map("{:g} px, by pixel".format)) for n in (min(CACHES), max(CACHES))
    )
    _, exact, ours = _pictures(0.5)
    return [
        Figure(
            "caches",
            lambda path: lines(
                pd.concat([shown, flat]), path, x="cache", y="shades", by="line",
                title=f"Shades a pixel, {SHOWN_BLUR:g} pixels of motion, {SAMPLES} samples",
                x_label="shading cells that the cache keeps", y_label="shades a pixel", log_x=True, log_y=True,
            ),
        ),
        Figure(
            "rates",
            lambda path: lines(
                rates.assign(line="decoupled"), path, x="shades", y="flip", by="line", title="Error by shading rate",
                x_label="shades a pixel", y_label="FLIP from shading every sample", log_x=True,
            ),
        ),
        Figure(
            "picture",
            lambda path: side_by_side(exact, ours, path, title="A shade for two pixels each way, 16 pixels of motion"),
        ),
    ]  # fmt: skip
