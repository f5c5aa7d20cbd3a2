"""Quad merging: what shading in 2x2 quads costs by triangle area, and what a buffer that merges them saves."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.frontier.picture_error import flip
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.machine import load_machine
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import heat_maps
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2010.quad_shading import QuadEvent, quad_shading

QUESTION = "By how much does merging quads of neighbouring triangles reduce shading, and what does that take?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
PUBLISHED = 8.0  # times less shading of pixel-sized triangles
SOURCE = (
    "Fatahalian et al. 2010, abstract: a small buffer reduces the shading of pixel-sized triangles by a factor of"
    " eight; samples a pixel, entries and exact area are not said there. Pixel-sized here: legs of a pixel, an area"
    " of 0.5 pixels"
)
SIDE = 64  # pixels of the screen
BLOCK = 16  # cells on a side of a block of the mesh, drawn block by block as a tessellator makes them
TURN, JITTER = 17.0, 0.18  # degrees of the mesh; of a leg, by which its corners are moved
AREAS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 100.0)  # pixels
PIXEL_SIZED = 0.5
SAMPLES = (4, 16)
ENTRIES = (1, 2, 4, 8, 16, 32, 64, 128)
BUFFER = 32
RULES = {2: "an edge in common", 1: "a corner in common", 0: "any polygon of the mesh"}
MACHINE = "h200"
FRAME: dict[str, Any] = {"width": 160, "height": 120, "spp": 4, "stamp": 2, "triangles": True}
SURE = (
    "Sure: the counts, which a list of dictionaries in plain Python gives as well. Not sure: which rule of adjacency,"
    " order and eviction the paper has, of which its abstract alone was at hand; and the prices."
)
FRAME_ENTRIES = (0, 8, 32, 128)
SHADER = "SHADE_WARPS"  # the event that prices the shader


def mesh(area: float, side: int = SIDE, seed: int = 7) -> Micropolygons:
    """Make a flat mesh of right triangles over the whole screen, in blocks, so that one follows its neighbour."""
    leg, turn = np.sqrt(2.0 * area), np.radians(TURN)
    count = BLOCK * int(np.ceil(np.sqrt(2.0) * side / leg / BLOCK) + 1)
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    grid = np.stack([j, i], axis=-1) - count / 2 + np.random.default_rng(seed).uniform(-JITTER, JITTER, (*i.shape, 2))
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = (grid @ turned.T * leg + side / 2).reshape(-1, 2)
    blocks, cells = np.arange(count // BLOCK) * BLOCK, np.arange(BLOCK)
    a = (
        (blocks[:, None, None, None] + cells[:, None]) * (count + 1) + (blocks[:, None, None] + cells)
    ).ravel()  # block row, block column, row, column
    b, c, d = a + 1, a + count + 1, a + count + 2
    corners = points[np.stack([a, d, c, a, b, d], axis=1).reshape(-1, 3)]
    on_screen = ((corners.max(axis=1) >= 0) & (corners.min(axis=1) < side)).all(axis=1)
    vertices = np.full((int(on_screen.sum()), 3, 3), 0.5, np.float32)
    vertices[..., :2] = corners[on_screen]
    return Micropolygons(vertices, np.arange(len(vertices), dtype=np.int32), np.full(len(vertices), 160, np.uint8))


def shaded(polygons: Micropolygons, spp: int, entries: int, shared: int = 1) -> tuple[int, NDArray[np.int32]]:
    """Quads shaded, and how often at each place."""
    samples = new_samples(SIDE, SIDE, sample_positions(spp))
    outputs, (work,), _ = quad_shading(polygons, samples, entries, load_machine(MACHINE).simt, shared)
    return work.total(QuadEvent.SHADED_QUADS), outputs.shades


def run(progress: Progress) -> Result:
    """Sweep area, samples, rule and buffer; then price a model's frame."""
    rows, buffers = [], []
    for area in AREAS:
        progress(f"triangles of {area:g} pixels")
        polygons = mesh(area)
        for spp in SAMPLES:
            plain, _ = shaded(polygons, spp, 0)
            for shared, rule in RULES.items():
                merged, _ = shaded(polygons, spp, BUFFER, shared)
                rows.append({"area": area, "spp": spp, "rule": rule, **_row(plain, merged)})
            if area in {PIXEL_SIZED, 10.0}:
                buffers += [
                    {"area": area, "spp": spp, "entries": n, **_row(plain, shaded(polygons, spp, n)[0])}
                    for n in ENTRIES
                ]
    table, by_entries = pd.DataFrame(rows), pd.DataFrame(buffers)
    progress("a model's frame")
    frames = _frames()
    title = "Quad merging: pixels shaded by triangle area, and by the buffer that merges quads"
    answer = _answer(table, by_entries)
    figures = _figures(table, by_entries)
    notes = _notes(by_entries, frames)
    tables = {"areas": table, "buffers": by_entries, "frames": frames}
    return Result(
        "exploration-quad_merging", title, SOURCE, _cells(table), answer, figures=figures, notes=notes, tables=tables
    )


def _row(plain: int, merged: int) -> dict[str, float]:
    return {"plain": 4 * plain / SIDE**2, "merged": 4 * merged / SIDE**2, "factor": plain / merged}


def _frames() -> pd.DataFrame:
    """Time and picture error of the teapot, and the shader from which merging pays by instructions issued."""
    runs = {n: simulate("teapot", pipeline="stamps", machine=MACHINE, merge_entries=n, **FRAME) for n in FRAME_ENTRIES}
    price = load_mix("stamps", load_machine(MACHINE).compute_capability).kernels["quad_shading"].prices[SHADER]
    length = sum(price.get(kind.name.lower(), 0) for kind in INSTRUCTION_CLASSES)
    rows = []
    for n, frame in runs.items():
        stage, warps = frame.stages.iloc[-1], frame.counts[f"quad_shading.{SHADER}"]
        rows.append(
            {
                "entries": n, "quads": frame.counts["quad_shading.SHADED_QUADS"], "shader_warps": warps,
                "others": stage["instructions"] - length * warps, "ms": stage["milliseconds"],
                "flip": flip(runs[0].image / 255.0, frame.image),
            }
        )  # fmt: skip
    table = pd.DataFrame(rows)
    table["pays_from"] = (table.others - table.others[0]) / (table.shader_warps[0] - table.shader_warps)
    return table


def _cells(table: pd.DataFrame) -> list[Cell]:
    """The published factor beside ours at a pixel's size, by rule; elsewhere ours alone."""
    cells = []
    for row in table.to_dict("records"):
        sized = row["area"] == PIXEL_SIZED
        if not sized and row["rule"] != RULES[1]:
            continue
        name = f"{row['area']:g} px, {row['spp']} samples, {row['rule']}"
        published = PUBLISHED if sized and row["rule"] == RULES[1] else None
        status: Status = "reported" if published is None else "reproduced"
        cells.append(
            Cell(
                name, f"shading / shading merged, {BUFFER} entries", "x", published=published, ours=row["factor"],
                aim=0.15 if published else None, status=status,
            )
        )  # fmt: skip
    return cells


def _answer(table: pd.DataFrame, buffers: pd.DataFrame) -> str:
    sized = table[table.area == PIXEL_SIZED].set_index(["spp", "rule"])
    corner, edge, any_ = (sized.xs(RULES[n], level="rule") for n in (1, 2, 0))
    rows = buffers[(buffers.area == PIXEL_SIZED) & (buffers.spp == max(SAMPLES))]
    enough = rows[rows.factor > 0.9 * rows.factor.max()].entries.min()
    by_rule = "; ".join(
        f"{rule}: {rows.factor[max(SAMPLES)]:.1f} ({rows.factor[min(SAMPLES)]:.1f})"
        for rule, rows in ((RULES[1], corner), (RULES[0], any_), (RULES[2], edge))
    )
    return (
        f"Triangles with legs of a pixel are shaded {corner.plain[max(SAMPLES)]:.1f} times a pixel in quads at"
        f" {max(SAMPLES)} samples. A buffer of {BUFFER} entries divides that by a factor that depends on who are"
        f" neighbours (published: {PUBLISHED:g}; in brackets at {min(SAMPLES)} samples): {by_rule}. {enough} entries"
        f" give 90 % of what {max(ENTRIES)} give."
    )


def _notes(buffers: pd.DataFrame, frames: pd.DataFrame) -> list[str]:
    large = buffers[(buffers.area == 10.0) & (buffers.spp == 4)].set_index("entries").factor
    row = frames[frames.entries == BUFFER].iloc[0]
    first = frames.iloc[0]
    return [
        (
            f"Triangles of 10 pixels, 4 samples: {large[BUFFER]:.2f} with {BUFFER} entries, {large[max(ENTRIES)]:.2f}"
            f" with {max(ENTRIES)}: the larger the triangles, the longer a quad waits for the row behind."
        ),
        (
            f"In software a warp that looks through {BUFFER} entries for every quad pays only with a shader of more"
            f" than {row.pays_from:.0f} instructions, by instructions issued (teapot, 4 samples, {MACHINE}; the mix is"
            f" counted by hand); with one of 66 the stage, which waits for its longest warp,"
            f" takes {row.ms:.3f} ms with merging and {first.ms:.3f} without."
        ),
        f"Merging changes the picture by a FLIP error of {row.flip:.5f}; at one sample a pixel, by none.",
        SURE,
    ]


def _figures(table: pd.DataFrame, buffers: pd.DataFrame) -> list[Figure]:
    corner = table[table.rule == RULES[1]]
    plain = corner.assign(y=corner.plain, line=corner.spp.map("{} samples, quads".format))
    merged = corner.assign(y=corner.merged, line=corner.spp.map(f"{{}} samples, merged by {BUFFER} entries".format))
    both = pd.concat([plain, merged])
    factors = buffers.assign(line=buffers.area.map("{:g} px".format) + buffers.spp.map(", {} samples".format))
    maps = {name: shaded(mesh(PIXEL_SIZED), 4, n)[1] for name, n in (("quads", 0), (f"{BUFFER} entries", BUFFER))}
    return [
        Figure(
            "areas",
            lambda path: lines(
                both, path, x="area", y="y", by="line", title="Pixels shaded for one that is seen, by triangle area",
                x_label="area of a triangle [pixels]", y_label="shades a pixel", log_x=True, log_y=True,
            ),
        ),
        Figure(
            "buffers",
            lambda path: lines(
                factors, path, x="entries", y="factor", by="line", title="What a merge buffer saves",
                x_label="entries of the buffer", y_label="shading without / with", log_x=True,
            ),
        ),
        Figure(
            "picture",
            lambda path: heat_maps(
                maps, path, title=f"How often each quad is shaded: triangles of {PIXEL_SIZED:g} pixels, 4 samples",
                unit="shades",
            ),
        ),
    ]  # fmt: skip
