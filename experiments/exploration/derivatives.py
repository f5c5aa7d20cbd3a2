"""Non-quad derivatives: mip levels from the planes of a triangle against differences in quads of 2x2 pixels."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.frontier.methods_scenes import Subject, grid_triangles, textured_subject
from tilestamp.experiments.frontier.methods_truth import Truth
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import heat_maps
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, clip_space_scene
from tilestamp.simulator.simulation import simulate

QUESTION = "What do derivatives without quads cost, and which mip levels do they choose?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
MACHINE = "h200"
WIDTH, HEIGHT = 160, 120
TEXELS = 64  # on a side of the texture
TILTS = (0.0, 0.5, 0.8, 0.9, 0.95)  # 1/w is 1 + tilt * y, y from -1 to 1: at 1 the horizon lies on the lower edge
AREAS = (1.0, 10.0, 100.0, 1000.0)  # pixels a triangle
PICTURE_AREA, PRICE_TILT = 100.0, 0.8
WAYS = ("quads", "planes")


def floor(tilt: float, area: float) -> Subject:
    """Make a textured plane over the whole screen, a texel a pixel where w is 1, of right triangles of an area."""
    leg = np.sqrt(2.0 * area)
    columns, rows = (int(np.ceil(size / leg)) + 1 for size in (WIDTH, HEIGHT))
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    w = 1.0 / (1.0 + tilt * y)
    uvs = coordinates(x, w).reshape(-1, 2).astype(np.float32)
    positions = np.stack([x * w, y * w, 0 * w, w], axis=-1).reshape(-1, 4).astype(np.float32)
    triangles = grid_triangles(columns, rows)
    textured = textured_subject().scene.mesh
    assert textured is not None  # noqa: S101 - made just so
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1))
    white, ids = np.ones((len(positions), 4), np.float32), np.zeros(len(triangles), np.int32)
    mesh = Mesh(positions, triangles, white, normals, True, uvs, ids, textured.textures)
    return Subject(f"floor of tilt {tilt:g}", clip_space_scene(mesh, "floor"), WIDTH, HEIGHT, np.eye(4))


def coordinates(x: NDArray[np.float64], w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Texture coordinates of the floor at a place across the screen and a depth."""
    scale = WIDTH / 2 / TEXELS
    return np.stack([x * w * scale, w * scale], axis=-1)


def levels(tilt: float) -> dict[str, NDArray[np.float64]]:
    """Level of detail at each pixel, (H, W), row 0 the lowest, not cut to those that exist: by quads, and as it is."""
    i, j = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))

    def texels(i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
        x, y = (2 * i + 1) / WIDTH - 1, (2 * j + 1) / HEIGHT - 1
        return TEXELS * coordinates(x, 1.0 / (1.0 + tilt * y))

    left, low = i // 2 * 2, j // 2 * 2
    quads = texels(left + 1, low) - texels(left, low), texels(left, low + 1) - texels(left, low)
    x, w = (2 * i + 1) / WIDTH - 1, 1.0 / (1.0 + tilt * ((2 * j + 1) / HEIGHT - 1))
    along = np.stack([w, 0 * w], axis=-1)  # a texel a pixel where w is 1
    up = np.stack([x, 1 + 0 * x], axis=-1) * (-tilt * w**2 * WIDTH / HEIGHT)[..., None]
    return {
        name: 0.5 * np.log2(np.maximum((right**2).sum(axis=-1), (upward**2).sum(axis=-1)))
        for name, (right, upward) in (("quads", quads), ("planes", (along, up)))
    }


def run(progress: Progress) -> Result:
    """Levels and pictures by tilt; instructions by area of the triangles."""
    rows, pictures = [], {}
    for tilt in TILTS:
        progress(f"tilt {tilt:g}")
        subject, level = floor(tilt, PICTURE_AREA), levels(tilt)
        truth, off = Truth(subject), np.abs(level["quads"] - level["planes"])
        row = {"tilt": tilt, "lod_mean": off.mean(), "lod_most": off.max()}
        for way in WAYS:
            image = _run(subject, way).image
            row[f"flip_{way}"] = truth.flip("binned", image)
            pictures[tilt, way] = image
        row["changed"] = float((pictures[tilt, "quads"] != pictures[tilt, "planes"]).any(axis=-1).mean())
        rows.append(row)
    by_tilt = pd.DataFrame(rows)
    by_area = pd.DataFrame([row for area in AREAS for row in _costs(area, progress)])
    cells = [
        reported(f"tilt {row['tilt']:g}", name, unit, row[column])
        for row in by_tilt.to_dict("records")
        for column, name, unit in (
            ("lod_mean", "levels apart, mean", "levels"), ("lod_most", "levels apart, most", "levels"),
            ("flip_quads", "FLIP, quads", ""), ("flip_planes", "FLIP, planes", ""),
        )
    ] + [
        reported(f"{row['area']:g} px, {row['way']}", "shader instructions a pixel", "1", row["instructions"])
        for row in by_area.to_dict("records")
    ]  # fmt: skip
    return finding(
        "derivatives", "Derivatives from planes against quads: levels, pictures, instructions", cells,
        _figures(by_tilt, by_area), _notes(by_tilt, by_area), {"tilts": by_tilt, "areas": by_area},
        folder="exploration",
    )  # fmt: skip


def _run(subject: Subject, way: str) -> Run:
    return simulate(
        subject.scene, "binned", MACHINE, width=WIDTH, height=HEIGHT, camera=subject.matrix, derivatives=way,
        cull_backfaces=False,
    )  # fmt: skip


def _costs(area: float, progress: Progress) -> list[dict[str, float | str]]:
    """Instructions, lanes and time of the shader for triangles of an area."""
    progress(f"triangles of {area:g} pixels")
    subject, rows = floor(PRICE_TILT, area), []
    for way in WAYS:
        run = _run(subject, way)
        stage, frame = run.stages.loc["PixelShader"], WIDTH * HEIGHT
        rows.append(
            {
                "area": area, "way": way, "instructions": 32 * stage["instructions"] / frame,
                "lanes": run.counts["PixelShader.WARP_LANES"] / frame, "ms": stage["milliseconds"],
                "texture_bytes": run.counts["PixelShader.TEXTURE_BYTES"],
            }
        )  # fmt: skip
    return rows


def _notes(by_tilt: pd.DataFrame, by_area: pd.DataFrame) -> list[str]:
    cost = by_area.pivot_table(index="area", columns="way", values=["instructions", "lanes", "ms"])
    ratio = cost["instructions"]["planes"] / cost["instructions"]["quads"]
    small, large = min(AREAS), max(AREAS)
    steep, worst = by_tilt.iloc[-1], by_tilt.lod_most.max()
    time = cost["ms"]["planes"] / cost["ms"]["quads"]
    return [
        (
            f"Without quads the pixel shader issues {ratio[small]:.2f} times the instructions at {small:g} pixel a"
            f" triangle, {ratio[large]:.2f} times at {large:g}: mostly because no helper pixel is shaded"
            f" ({cost['lanes']['quads'][small]:.2f} lanes a pixel in quads at {small:g} pixel,"
            f" {cost['lanes']['quads'][large]:.2f} at {large:g})."
        ),
        "The derivatives themselves are 8 warp instructions (4 FFMA, 4 FMUL) instead of 13 (4 FADD, 6 SHFL, 3 LOP3).",
        (
            f"On a floor at a tilt of {steep.tilt:g} quads choose a level {steep.lod_mean:.3f} off in the mean and"
            f" {worst:.2f} at most; FLIP from the converged picture is {steep.flip_quads:.4f} by quads and"
            f" {steep.flip_planes:.4f} by planes, and {steep.changed:.0%} of the pixels differ at all."
        ),
        f"Modelled time of the shader on the {MACHINE}: {time[small]:.2f} and {time[large]:.2f} times that of quads.",
        (
            "Sure: values of the planes, which fractions give as well; and the instructions of the derivatives, read"
            " from machine code. Not sure: the rest of the shader, whose mix is Zhang's with that difference applied."
        ),
    ]


def _figures(by_tilt: pd.DataFrame, by_area: pd.DataFrame) -> list[Figure]:
    errors = pd.concat([by_tilt.assign(line=way, y=by_tilt[f"flip_{way}"]) for way in WAYS])
    off = {f"tilt {tilt:g}": np.abs(np.subtract(*levels(tilt).values()))[::-1] for tilt in (0.8, 0.95)}
    return [
        Figure(
            "instructions",
            lambda path: lines(
                by_area, path, x="area", y="instructions", by="way", title="Instructions of the pixel shader",
                x_label="area of a triangle [pixels]", y_label="instructions a pixel of the screen", log_x=True,
            ),
        ),
        Figure(
            "pictures",
            lambda path: lines(
                errors, path, x="tilt", y="y", by="line", title="Error of the picture on a floor",
                x_label="tilt (1: the horizon lies on the lower edge)", y_label="FLIP from the converged picture",
            ),
        ),
        Figure(
            "levels",
            lambda path: heat_maps(off, path, title="How far off quads choose the mip level", unit="levels"),
        ),
    ]  # fmt: skip
