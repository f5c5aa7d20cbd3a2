"""Texture memory traffic: row-major against tiled texels, by minification and by the direction of the rows."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, reported
from tilestamp.models.machine import load_machine
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.binned import BinnedOptions, binned
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.zhang2025.pixel_shader import Filter
from tilestamp.simulator.work import Work

QUESTION = "When do tiled texels save traffic?"
SLOW = True  # with what it needs compiled, more than the first run should take

MACHINE = "ga104"
SIZE = 512  # pixels and texels on a side
MINIFICATIONS = (0.5, 1.0, 2.0, 4.0, 8.0)  # texels a pixel
ANGLES = (0, 45, 90)  # degrees between the rows of the texture and those of the screen
FILTERS: tuple[Filter, ...] = ("bilinear", "trilinear")
LAYOUTS: dict[str, dict[str, Any]] = {
    "rows": {"texture_layout": "rows"},
    "tiles 4x4": {"texture_tile": 4},
    "tiles 8x8": {"texture_tile": 8},
}


def wall(minification: float, degrees: int) -> Scene:
    """Make a square over the whole screen, its texture at so many texels a pixel, turned by an angle."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    turn = np.radians(degrees)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    uvs = (corners @ rotation.T / 2.0 * minification).astype(np.float32)
    positions = np.concatenate([corners, np.zeros((4, 1)), np.ones((4, 1))], axis=1).astype(np.float32)
    texture = np.random.default_rng(1).integers(0, 256, (SIZE, SIZE, 4), dtype=np.uint8)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    ids = np.zeros(2, np.int32)
    return Scene("wall", mesh=Mesh(positions, triangles, uvs=uvs, texture_ids=ids, textures=(texture,)))


def shader(scene: Scene, simt: Simt, layout: str, texture_filter: Filter) -> Work:
    """Draw the wall and give the pixel shader's work."""
    options = BinnedOptions(texture_filter=texture_filter, **LAYOUTS[layout])
    frame = binned(scene, np.eye(4), SIZE, SIZE, simt, options, Executor())
    return next(work for work in frame.works if isinstance(work, Work) and work.stage == "PixelShader")


def _answer(cells: list[Cell]) -> str:
    """Settings in which tiles of 4x4 texels send fewer transactions than rows."""
    ratios = [float(cell.ours) for cell in cells]
    fewer = sum(ratio < 1 for ratio in ratios)
    return (
        f"In {fewer} of {len(ratios)} settings tiles of 4x4 texels send fewer transactions than rows, "
        f"{min(ratios):.2f} to {max(ratios):.2f} times as many."
    )


def run(progress: Callable[[str], None]) -> Result:
    """Count texel transactions of both layouts."""
    simt = load_machine(MACHINE).simt
    rows, cells, wide = [], [], []
    for texture_filter in FILTERS:
        for degrees in ANGLES:
            progress(f"{texture_filter} {degrees}")
            for minification in MINIFICATIONS:
                counts = {}
                for layout in LAYOUTS:
                    count = shader(wall(minification, degrees), simt, layout, texture_filter).counts()
                    counts[layout] = count["TEXTURE_TRANSACTIONS"] / count["WARPS"]
                    name = f"{layout}, {degrees} degrees"
                    rows.append(
                        {
                            "minification": minification, "layout": layout, "degrees": degrees,
                            "filter": texture_filter, "series": name, "transactions_a_warp": counts[layout],
                            "bytes": count["TEXTURE_BYTES"],
                        }
                    )  # fmt: skip
                label = f"{texture_filter}, {degrees} degrees, {minification:g} texels a pixel"
                ratio = counts["tiles 4x4"] / counts["rows"]
                cells.append(reported(label, "tiles 4x4 / rows, transactions", "1", ratio))
                wide.append(counts["tiles 8x8"] / counts["rows"])
    table = pd.DataFrame(rows)
    shown = table[(table["filter"] == "bilinear") & (table.layout != "tiles 8x8")]
    figure = Figure(
        "transactions",
        lambda path: lines(
            shown, path, x="minification", y="transactions_a_warp", by="series", title="Texel transactions (bilinear)",
            x_label="texels a pixel", y_label="transactions a warp (8 quads)",
        ),
    )  # fmt: skip
    notes = [
        (
            "Counted before any cache: distinct 32-byte sectors of each warp load, 32 bytes each. The source gives no "
            "size of a storage tile. In tiles of 4x4 texels a sector is 4x2 texels, in tiles of 8x8 it is 8x1, as in "
            f"rows: 8x8 / rows lies between {min(wide):.2f} and {max(wide):.2f}, so if sectors are what his layout "
            "saves, his tiles are at most 4 texels wide."
        ),
        "Two texels a pixel or more, without mip levels: tiles lose, since texels of a row lie in different ones.",
    ]
    source = "Zhang 2025 names an optimized tile linear storage, without figures"
    title = "Texture traffic by layout"
    tables = {"traffic": table}
    return Result(
        "zhang2025-texture_traffic", title, source, cells, _answer(cells), figures=[figure], notes=notes, tables=tables
    )
