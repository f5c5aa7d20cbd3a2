"""H200, Zhang 2025: the author's kernels beside ours, on the same inputs, and his frames on a stream and as a graph.

Every kernel and clear of a frame without a texture, and of one with (``textured_inputs``), drawn with the author's own
faults: whole blocks of tiles, and Hi-Z without a margin. The gap between the launches of a stream and the step of the
graph were fitted to the frames of one scene. The step is longer than the machine file's (1.1 us): the graph's clears
start together, and each takes about 2 us longer than on the stream.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

from tilestamp.experiments.harness.result import Result
from tilestamp.experiments.silicon.textured_compare import SPAN, Drawn, compared, entry, rows
from tilestamp.experiments.silicon.textured_inputs import SPAN_METRIC, VARIABLE, Measured, read_measured
from tilestamp.experiments.zhang2025.graph import nodes
from tilestamp.models.fitted import Fitted
from tilestamp.models.launch_graph import as_graph, on_stream
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.zhang2025.frame_clears import cleared_bytes
from tilestamp.simulator.work import Work

QUESTION = "How far off are Zhang's own kernels on an H200?"
SLOW = True  # draws every measured frame

NAME = "silicon-textured_binned"
TITLE = "H200, Zhang 2025's kernels, model against machine"
SOURCE = f"One NVIDIA H200, 2026-11-29: the folder that {VARIABLE} names"
KERNELS = {"PrimitiveCompaction": "PrimitiveCompactionKernel", "FineRasterizer": "FineRasterizerWIP"}  # his other names
GAP = Fitted("zhang2025 on an H200: microseconds between launches", 1.85, (f"zh_Duck_fit | {NAME}",))
STEP = Fitted("zhang2025 on an H200: microseconds of a step of the graph", 4.2, (f"zh_Duck_fit | {NAME}",))
OPTIONS: dict[str, Any] = {"original_faults": True, "texture_levels": 4, "texture_layout": "rows"}
EVENTS = {  # of the sources on a CPU: kernel, metric, ours, how many of ours are one of theirs
    ("PrimitiveCompactionKernel", "primitives_kept"): ("PrimitiveCompaction.KEPT", 1),
    ("PrimitiveBinning", "bin_entries"): ("PrimitiveBinning.ENTRIES", 1),
    ("PrimitiveBinning", "bin_chunks"): ("PrimitiveBinning.CHUNKS", 1),
    ("CoarseRasterizer", "rounds"): ("CoarseRasterizer.ROUNDS", 1),
    ("CoarseRasterizer", "edge_lanes"): ("CoarseRasterizer.EDGE_LANES", 1),
    ("CoarseRasterizer", "hi_z_lanes"): ("CoarseRasterizer.HI_Z_LANES", 1),
    ("FineRasterizerWIP", "rounds"): ("FineRasterizer.ROUNDS", 1),
    ("FineRasterizerWIP", "sample_hits"): ("FineRasterizer.SAMPLE_HITS", 1),
    ("FineRasterizerWIP", "fragments"): ("FineRasterizer.QUADS", 0.25),
}


def run(progress: Callable[[str], None]) -> Result:
    """Draw and price every measured frame."""
    return compared(NAME, TITLE, SOURCE, "zh", partial(_frames, progress))


def _frames(progress: Callable[[str], None], measured: Measured) -> Iterator[dict[str, Any]]:
    for config in ("stream", "stream_textured"):
        progress(f"{measured.name} {config}")
        yield from _rows(measured, config)


def _rows(measured: Measured, config: str) -> Iterator[dict[str, Any]]:
    """One frame: its kernels, what goes on between them, and the events of the sources on a CPU."""
    drawn = _drawn(measured.name, config == "stream_textured")
    kernels = [kernel_name(work, drawn) for work in drawn.frame.works if isinstance(work, Work)]
    if ("stream", "ROP", 0, "us_median") not in measured.on_gpu:  # the original stops there
        kernels = ["" if kernel == "ROP" else kernel for kernel in kernels]
    yield from rows(measured, Drawn(config, drawn, kernels))
    about = {"scene": measured.name, "kernel": "frame", "instance": 0}
    for way, ours in spans(drawn).items():
        kind = config if way == "stream" else way
        place = (kind, "frame", 0, SPAN_METRIC)
        if place in measured.on_gpu and (way == "stream" or config == "stream") and "" not in kernels:
            yield about | {"config": kind} | entry(SPAN, ours, measured.on_gpu[place], 0.08)
    if config == "stream":
        for (kernel, metric), (event, share) in EVENTS.items():
            theirs = measured.on_cpu["counts", kernel, metric]
            yield (
                about | {"config": "counts", "kernel": kernel} | entry(metric, drawn.counts[event] / share, theirs, 0.0)
            )


@cache
def _drawn(name: str, textured: bool) -> Run:
    """Draw once: where a fitted number is moved the same run is priced again."""
    return draw(read_measured(name), textured=textured)


def draw(measured: Measured, *, textured: bool) -> Run:
    """Draw one frame as the author's program does."""
    scene = measured.scene
    if not textured and scene.mesh is not None:
        scene = replace(scene, mesh=replace(scene.mesh, texture_ids=None, textures=()))
    return simulate(
        scene, "binned", "h200", width=measured.width, height=measured.height, camera=measured.matrix, **OPTIONS
    )


def kernel_name(work: Work, frame: Run) -> str:
    """The author's name of one of our kernels; memsets go by their bytes."""
    if work.variant:
        sizes = cleared_bytes(frame.counts["PrimitiveAssembly.WARP_LANES"], frame.width * frame.height)
        return f"memset{sizes[work.variant]}"
    if work.stage == "PixelShader" and frame.counts["PixelShader.TEXTURED_WARPS"]:
        return "PixelShaderTex"
    return KERNELS.get(work.stage, work.stage)


def spans(frame: Run) -> dict[str, float]:
    """Microseconds from a frame's first start to its last end: on one stream, and as the author's graph."""
    *graph, last = nodes(frame)
    return {
        "stream": on_stream([*graph, last], GAP.value, 0.0).gpu_us,
        "graph": as_graph(graph, STEP.value, 0.0).gpu_us + STEP.value + last.gpu_us,
    }
