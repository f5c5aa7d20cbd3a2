"""As published: what the sources of Ru and Zhang do that our pipelines do only where asked.

Zhang divides rows of tiles by the 4 of a block and drops the rest, ends a pixel's list with number 0, which is also
the number of the frame's first fragment, and keeps 4 levels of a texture. Ru's samples lie at integer coordinates.
Where the picture differs from what was meant is found by bisection; the cure is our default. A missing barrier in
Zhang's PrimitiveBinning has no row: none of 1,000 frames on an H200 showed what it can do.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Result
from tilestamp.experiments.stability.boundary import Boundary, Scale, atlas_result, bisect
from tilestamp.experiments.stability.methods import MACHINE, draw, flat_scene, machine
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "What do the published sources of Ru and Zhang do that our pipelines do only on request?"
SLOW = True  # the kernels of these pipelines are compiled for nothing else in the first run

WIDTH = 64  # pixels
FULL = 1920, 1080  # pixels, where costs are measured
BLOCK_ROWS = 32  # pixels: four tiles
SIZE = 64  # pixels on a side
TEXELS = 2048  # on a side of the noise
NOISY = 1.25  # times the noise that all levels leave
HARDEST = 44.0  # texels a pixel
LEVELS = 4
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
TWO_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def screen(width: int, height: int, **options: Any) -> Run:
    """Cover the whole screen by two triangles."""
    positions = np.column_stack([CORNERS, np.zeros(4), np.ones(4)])
    scene = Scene.from_clip_space(positions, TWO_TRIANGLES)
    return simulate(scene, "binned", machine(), width=width, height=height, **options)


def rows_missing(height: float) -> int:
    """Rows that the original leaves empty."""
    ids = screen(WIDTH, int(height), original_faults=True).triangle_ids
    assert ids is not None  # noqa: S101 - all pipelines of triangles give them
    return int((ids < 0).all(axis=1).sum())


def pixels_missing(leg: float) -> int:
    """Pixels that the original leaves empty of a right triangle with legs of so many pixels."""
    triangle = np.array([[[8.0, 8.0], [8.0 + leg, 8.0], [8.0, 8.0 + leg]]])
    whole, lossy = (
        draw(flat_scene(triangle, SIZE), "binned", SIZE, original_faults=faults).triangle_ids
        for faults in (False, True)
    )
    assert whole is not None  # noqa: S101 - all pipelines of triangles give them
    assert lossy is not None  # noqa: S101
    return int(np.count_nonzero((whole >= 0) & (lossy < 0)))


def spread(minification: float, levels: int = LEVELS) -> float:
    """Standard deviation of a noise texture at so many texels a pixel: what is left of the noise, of 255."""
    texture = np.full((TEXELS, TEXELS, 4), 255, np.uint8)
    texture[..., :3] = np.random.default_rng(1).integers(0, 256, (TEXELS, TEXELS, 1), dtype=np.uint8)
    positions = np.column_stack([CORNERS, np.zeros(4), np.ones(4)]).astype(np.float32)
    uvs = (CORNERS / 2 * minification * SIZE / TEXELS).astype(np.float32)
    mesh = Mesh(positions, TWO_TRIANGLES, uvs=uvs, texture_ids=np.zeros(2, np.int32), textures=(texture,))
    image = draw(Scene("noise", mesh=mesh), "binned", SIZE, camera=np.eye(4), texture_levels=levels).image
    assert image is not None  # noqa: S101 - nothing is sampled
    return float(image.astype(np.float64).std())


def noisy(minification: float) -> bool:
    """Whether the original's levels leave clearly more noise than all levels do."""
    return spread(minification) > NOISY * spread(minification, 0)


def columns_wrong(offset: float, samples: str = "corners") -> int:
    """Pixels of a rectangle, moved right by part of a pixel, that its samples at centres would not give."""
    low, high = np.array([8.0 + offset, 8.25]), np.array([24.0 + offset, 24.25])
    square = np.array([[low, [high[0], low[1]], high], [low, high, [low[0], high[1]]]])
    meant, drawn = (
        draw(flat_scene(square, SIZE), "tiled", SIZE, samples=where).triangle_ids for where in ("centers", samples)
    )
    assert meant is not None  # noqa: S101 - all pipelines of triangles give them
    assert drawn is not None  # noqa: S101
    return int(np.count_nonzero((meant >= 0).any(axis=0) != (drawn >= 0).any(axis=0)))


def boundary(
    fails: Callable[[float], object], low: float, high: float, scale: Scale
) -> tuple[float | None, float | None]:
    """Value that holds, and value that breaks."""
    return bisect(lambda value: bool(fails(value)), low, high, scale=scale)


def run(progress: Progress) -> Result:
    """Find where each original leaves out, or moves, what was meant."""
    progress("stability/as_published: rows, fragment 0")
    late, first = _rows(), _fragment()
    progress("stability/as_published: levels, samples")
    boundaries = [late, first, _levels(), _samples()]
    return atlas_result("stability/as_published", "What the published sources leave out", boundaries)


def _rows() -> Boundary:
    first, missing = 33 * BLOCK_ROWS, rows_missing(FULL[1])
    slower = _milliseconds(original_faults=False, stage="FineRasterizer"), _milliseconds(stage="FineRasterizer")
    return Boundary(
        "binned, original_faults", "height of the picture", "pixels",
        *boundary(rows_missing, first, FULL[1], "integer"),
        f"rows beyond whole blocks of {BLOCK_ROWS} are never drawn: {missing} of {FULL[1]}",
        "a last row of blocks, partly empty: original_faults=False",
        f"FineRasterizer {100 * (slower[0] / slower[1] - 1):+.1f} % of {slower[1]:.3g} ms on the {MACHINE}",
    )  # fmt: skip


def _fragment() -> Boundary:
    slower = _milliseconds(original_faults=False, stage="ROP"), _milliseconds(stage="ROP")
    return Boundary(
        "binned, original_faults", "legs of the only triangle", "pixels",
        *boundary(pixels_missing, 2, 32, "integer"),
        f"fragment 0 of a frame is lost: {pixels_missing(2)} pixel of a small triangle, {pixels_missing(32)} of any",
        "a list that ends with no fragment's number: original_faults=False",
        f"ROP {100 * (slower[0] / slower[1] - 1):+.1f} %, with the rows above",
    )  # fmt: skip


def _levels() -> Boundary:
    left = spread(HARDEST), spread(HARDEST, 0)
    bytes_more = 4 / 3 / sum(0.25**level for level in range(LEVELS)) - 1
    return Boundary(
        f"binned, texture_levels={LEVELS}", "minification", "texels a pixel", *boundary(noisy, 4.1, HARDEST, "log"),
        f"noise stays: {left[0]:.1f} of 255 at {HARDEST:g} texels a pixel (standard deviation), not {left[1]:.1f}",
        "all levels: texture_levels=0", f"{100 * bytes_more:+.2f} % of a texture's bytes",
    )  # fmt: skip


def _samples() -> Boundary:
    corners, centers = (screen_tiled(samples=where).milliseconds for where in ("corners", "centers"))
    return Boundary(
        "tiled, per-primitive, samples=corners", "an edge right of a pixel's left border", "pixels",
        *boundary(columns_wrong, 0.75, 0.25, "linear"),
        "the picture is that of a model half a pixel right and up", "samples=centers",
        f"{100 * (centers / corners - 1):+.2f} % of {corners:.3g} ms on the {MACHINE}",
    )  # fmt: skip


def screen_tiled(**options: Any) -> Run:
    """Draw a rectangle by tiles, at the size where costs are measured."""
    square = np.array([[[8, 8], [56, 8], [56, 56]], [[8, 8], [56, 56], [8, 56]]], np.float64)
    return simulate(flat_scene(square, SIZE), "tiled", machine(), width=FULL[1], height=FULL[1], **options)


def _milliseconds(*, original_faults: bool = True, stage: str) -> float:
    run = screen(*FULL, original_faults=original_faults)
    return float(run.stages.loc[stage, "milliseconds"])
