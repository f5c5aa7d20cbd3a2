"""Zhang 2025, CUDA graph impact: the frame on one stream against a graph with parallel branches."""

from collections.abc import Callable

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.experiments.zhang2025.setting import HEIGHT, SOURCE, WIDTH, bunny, draw, published
from tilestamp.models.fitted import Fitted
from tilestamp.models.launch import Launch
from tilestamp.models.launch_graph import Node, as_graph, on_stream
from tilestamp.models.machine import load_machine
from tilestamp.reports.bars import stacked_bars
from tilestamp.simulator.run import Run
from tilestamp.simulator.work import Work

QUESTION = "What does a CUDA graph save over a stream?"
SLOW = True  # with what it needs compiled, more than the first run should take

MACHINE = "ga104"
# Which stage waits for a buffer to be cleared (his graph).
TARGETS = {
    "bin_allocator": "PrimitiveBinning",
    "tile_allocator": "CoarseRasterizer",
    "quad_allocator": "FineRasterizer",
    "slot_counter": "PrimitiveAssembly",
    "fragments": "FineRasterizer",
    "target": "ROP",
    "hi_z": "CoarseRasterizer",
    "depth": "FineRasterizer",
    "primitives": "PrimitiveAssembly",
    "pixel_base": "PixelShader",
    "bin_counts": "PrimitiveBinning",
    "tile_counts": "CoarseRasterizer",
    "Matrices": "VertexFetchAndShading",
}
# Compaction clears its two buffers before the kernel, on its own stream, and copies the count after it.
ORDER = (
    "VertexFetchAndShading", "PrimitiveAssembly", "block_sums", "block_sum", "PrimitiveCompaction", "PrimitiveCount",
    "TriangleSetup", "PrimitiveBinning", "CoarseRasterizer", "FineRasterizer", "PixelShader", "ROP",
)  # fmt: skip
CLEARS = "Clears"  # the stage
CLEARED = ("block_sums", "block_sum")
COPIES = ("Matrices", "PrimitiveCount")  # a few bytes each
LAST = "StreamingToFrameBuffer"  # outside of the graph, after the window's buffer is mapped
WAITS = {"PrimitiveBinning": ("PrimitiveCount",), "CoarseRasterizer": ("PrimitiveBinning", "TriangleSetup")}
MAPPING_CALLS = 4  # assumed: to map and to unmap, the driver submits to both of its contexts
FRAME = f"bunny {WIDTH}x{HEIGHT}"
FITTED = ("gpu_time_rasterize_pipeline", "default_stream")  # the cell that gives the gap between calls
GAP = "zhang2025: microseconds between calls"
SAME = {"gpu_time": "gpu_time_rasterize_pipeline", "total_frame_time": "cpu_time"}  # ours: one number in two rows


def nodes(run: Run) -> list[Node]:
    """All launches, copies and clears of a frame, with what they wait for; the last one is outside of the graph."""
    places = {work.variant or work.stage: i for i, work in enumerate(run.frame.works) if isinstance(work, Work)}
    return [
        *(_node(run, places, name, ()) for name in TARGETS),
        *(_node(run, places, stage, _before(stage)) for stage in ORDER),
        _node(run, places, LAST, ()),
    ]


def _before(stage: str) -> tuple[str, ...]:
    """What a stage waits for: buffers that are cleared, and the stages before it."""
    cleared = tuple(name for name, target in TARGETS.items() if target == stage)
    first = ORDER.index(stage)
    return (*cleared, *WAITS.get(stage, ORDER[max(0, first - 1) : first]))


def _node(run: Run, places: dict[str, int], name: str, after: tuple[str, ...]) -> Node:
    """One launch by its buffer's or stage's name; a copy takes what a kernel without work takes."""
    if name in COPIES:
        return Node(name, run.machine.launch.kernel_us, after)
    launch, timing = run.launches[places[name]], run.timings[places[name]]
    assert isinstance(launch, Launch)  # noqa: S101 - no fixed function in this pipeline
    fills = launch.grid > timing.details["resident_blocks"] * run.machine.sm.count
    return Node(name, 1e3 * timing.milliseconds, after, shares=launch.stage == CLEARS, fills=fills)


def run(progress: Callable[[str], None]) -> Result:
    """Price the frame both ways."""
    scene = bunny()
    if scene is None:
        warning = "bunny_5k is not on the scene path (TILESTAMP_SCENES): nothing was drawn"
        warnings = [warning]
        return Result("zhang2025-graph", "Stream against graph", SOURCE, [], warnings=warnings)
    machine = load_machine(MACHINE)
    progress(MACHINE)
    *frame, last = nodes(draw(scene, MACHINE))
    asked = {str(row["metric"]): row for row in published("graph").to_dict("records")}
    busy = on_stream([*frame, last], 0.0, 0.0).gpu_us
    between = (1e3 * float(asked[FITTED[0]][f"{FITTED[1]}_ms"]) - busy) / (len(frame) + 1)
    gap = Fitted(GAP, between, (" | ".join((FRAME, "zhang2025-graph", *FITTED)),)).value
    stream = on_stream([*frame, last], gap, 0.0).gpu_us
    graph = as_graph(frame, gap, 0.0)
    mapping = MAPPING_CALLS * gap
    ended = graph.gpu_us + mapping + last.gpu_us
    pairs = {
        "gpu_time_rasterize_pipeline": (stream, graph.gpu_us),
        "gpu_time": (stream, ended),
        "cpu_time": (stream + mapping + machine.launch.sync_us, ended + machine.launch.sync_us),
        "total_frame_time": (stream + mapping + machine.launch.sync_us, ended + machine.launch.sync_us),
    }
    cells = [
        Cell(
            metric,
            column,
            "ms",
            published=float(asked[metric][f"{column}_ms"]),
            ours=us / 1e3,
            aim=0.25,
            frame=FRAME,
            of=((SAME[metric], column),) if metric in SAME else (),
        )
        for metric, both in pairs.items()
        for column, us in zip(("default_stream", "cuda_graph"), both, strict=True)
    ]
    table = _table([*frame, last], graph.path)
    cleared = float(table.loc[table.kind == "clear", "gpu_us"].sum())
    kernels = float(table.loc[table.kind == "kernel", "gpu_us"].sum())
    notes = [
        f"Critical path of the graph: {' > '.join(graph.path)}.",
        (
            f"On the stream the kernels take {kernels / 1e3:.2f} ms and clears and copies {cleared / 1e3:.2f} ms, "
            "most of it the fragment stream's; the rest is gaps."
        ),
        (
            f"The only constant: {gap:.0f} us from the end of a call to the start of one that waits for it, on "
            f"the stream ({len(frame) + 1} calls) as in the graph ({len(graph.path)} on the path). It is far above the "
            f"{machine.launch.stream_us} us measured on Linux; presumably Windows hands calls over in batches."
        ),
        f"Assumed: mapping and unmapping the window's buffer costs {MAPPING_CALLS} such gaps.",
    ]
    bars = _breakdown(table, graph.path, gap, mapping)
    columns = {"stream": "default_stream_ms", "graph": "cuda_graph_ms"}
    known = pd.DataFrame({"GPU time": {name: float(asked["gpu_time"][key]) for name, key in columns.items()}})
    figure = Figure(
        "breakdown",
        lambda path: stacked_bars(
            bars, path, title="A frame on the stream, and a graph's critical path", unit="time [ms]", published=known
        ),
    )
    answer = (
        f"The pipeline takes {graph.gpu_us / 1e3:.2f} ms as a graph and {stream / 1e3:.2f} ms on a stream: "
        f"{stream / graph.gpu_us:.2f} times as long."
    )
    tables = {"graph": table}
    return Result(
        "zhang2025-graph", "Stream against graph", SOURCE, cells, answer, figures=[figure], notes=notes, tables=tables
    )


def _table(frame: list[Node], path: tuple[str, ...]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "node": node.name,
                "kind": "clear" if node.name in TARGETS or node.name in CLEARED or node.name in COPIES else "kernel",
                "gpu_us": node.gpu_us,
                "after": " ".join(node.after),
                "critical": node.name in path,
            }
            for node in frame
        ]
    )


def _breakdown(table: pd.DataFrame, path: tuple[str, ...], gap: float, mapping: float) -> pd.DataFrame:
    """Milliseconds of kernels, clears, gaps and mapping: all nodes, and those of the critical path."""
    chosen = {"stream": table, "graph": table[table.critical | (table.node == LAST)]}
    rows = {
        name: {
            "kernels": part.loc[part.kind == "kernel", "gpu_us"].sum() / 1e3,
            "clears and copies": part.loc[part.kind == "clear", "gpu_us"].sum() / 1e3,
            "gaps": (len(path) if name == "graph" else len(table)) * gap / 1e3,
            "mapping": mapping / 1e3,
        }
        for name, part in chosen.items()
    }
    return pd.DataFrame(rows).T
