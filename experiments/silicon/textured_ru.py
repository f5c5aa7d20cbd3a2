"""H200, Ru 2016: the author's kernels beside ours, on the same inputs.

Tile lists and raster at four tile sizes with and without culling, one thread a triangle, nearest filtering, ambient
occlusion: every kernel and memset of every configuration that was measured (``textured_inputs``).
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from tilestamp.experiments.harness.result import Result
from tilestamp.experiments.silicon.textured_compare import Drawn, compared, rows
from tilestamp.experiments.silicon.textured_inputs import VARIABLE, Measured
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

QUESTION = "How far off are Ru's own kernels on an H200?"
SLOW = True  # draws every measured frame

SOURCE = f"One NVIDIA H200, 2026-11-29: the folder that {VARIABLE} names"
KERNELS = {  # ours, and the author's
    "vertex_shading": "_vertexTransformAndAssembly",
    "primitive_assembly": "_primitiveAssembly",
    "tile_lists": "fillTileTriLists",
    "tiled_raster": "tileBasedRasterize",
    "per_primitive_raster": "_rasterize",
    "ambient_occlusion": "computeSSAO",
    "occlusion_blur": "ssaoBlur",
    "fragment_shading_bilinear": "render",
    "fragment_shading_nearest": "renderNearest",
    "copy": "sendImageToPBO",
    "clear_depth": "initDepth",
}
CLEARED = {"clear_colors": 12, "clear_fragments": 56}  # bytes a pixel


def run(progress: Callable[[str], None]) -> Result:
    """Draw and price every measured frame."""
    return compared("silicon-textured_ru", TITLE, SOURCE, "ru", partial(_rows, progress))


TITLE = "H200, Ru 2016's kernels, model against machine"


def _rows(progress: Callable[[str], None], measured: Measured) -> Iterator[dict[str, Any]]:
    for drawn in drawn_frames(measured):
        progress(f"{measured.name} {drawn.config}")
        yield from rows(measured, drawn)


def drawn_frames(measured: Measured) -> Iterator[Drawn]:
    """Draw each configuration that was measured."""
    for config in measured.configs:
        frame = draw(measured, config)
        counted_as = ("tiled_t8_cull", "vertex") if config == "tiled_t8_cull_original" else ()
        yield Drawn(config, frame, [kernel_name(work.kernel, frame) for work in frame.frame.works], counted_as)


def draw(measured: Measured, config: str) -> Run:
    """Draw one configuration, samples at the corners of pixels as the original has them."""
    parts = config.split("_")
    options: dict[str, Any] = {"samples": "corners", "cull_backfaces": "cull" in parts}
    if parts[0] == "tiled":
        options |= {"tile": int(parts[1].removeprefix("t")), "capacity": "safe" if "roomy" in parts else "original"}
        options |= {"ssao": "ssao" in parts, "texture_filter": "nearest" if "nearest" in parts else "bilinear"}
    pipeline = "tiled" if parts[0] == "tiled" else "per-primitive"
    return simulate(
        measured.scene, pipeline, "h200", width=measured.width, height=measured.height, camera=measured.matrix,
        **options,
    )  # fmt: skip


def kernel_name(kernel: str, frame: Run) -> str:
    """The author's name of one of our kernels; memsets go by their bytes."""
    pixels = frame.width * frame.height
    if kernel in CLEARED:
        return f"memset{CLEARED[kernel] * pixels}"
    if kernel == "clear_tile_counters":
        tile = frame.options["tile"]
        return f"memset{4 * -(-frame.width // tile) * -(-frame.height // tile)}"
    return KERNELS.get(kernel, "")
