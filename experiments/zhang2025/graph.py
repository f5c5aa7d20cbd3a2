"""Zhang 2025, CUDA graph impact: the frame on one stream against a graph with parallel branches."""

from collections.abc import Callable

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.experiments.zhang2025.setting import HEIGHT, SOURCE, WIDTH, bunny, draw, published
from tilestamp.models.fitted import Fitted
from tilestamp.models.launch_graph import Node, as_graph, on_stream
from tilestamp.models.machine import Machine, load_machine
from tilestamp.reports.plots import stacked_bars

SLOW = True  # with what it needs compiled, more than the first run should take

MACHINE = "ga104"
PIXELS = WIDTH * HEIGHT
TRIANGLES = 4968
BINS, TILES, QUEUES, WAVES = 256, 256, 4, 2046  # his buffers have room for so many
# What he clears or copies before the stages in each frame, in bytes, and the stage that waits for it (his graph).
CLEARS = {
    "Matrices": (64, "VertexFetchAndShading"),
    "TrunkAllocator": (4, "PrimitiveBinning"),
    "TileTrunkAllocator": (4, "CoarseRasterizer"),
    "QuadAllocator": (4, "FineRasterizer"),
    "SubTriangleCounter": (4, "PrimitiveAssembly"),
    "FragmentStream": (48 * 4 * PIXELS, "FineRasterizer"),
    "RenderTarget": (16 * PIXELS, "ROP"),
    "HiZ": (4 * BINS * TILES, "CoarseRasterizer"),
    "DepthBuffer": (4 * PIXELS, "FineRasterizer"),
    "PrimitiveStream": (4 * TRIANGLES * 112, "PrimitiveAssembly"),
    "PixelBaseIdx": (4 * PIXELS, "PixelShader"),
    "SubQueuePrimCount": (4 * WAVES * 256, "PrimitiveBinning"),
    "TileQueuePrimCount": (4 * BINS * TILES * QUEUES, "CoarseRasterizer"),
}
# Compaction clears its two buffers before the kernel, on its own stream, and copies the count after it.
ORDER = (
    "VertexFetchAndShading", "PrimitiveAssembly", "BlockSums", "Sum", "PrimitiveCompaction", "PrimitiveCount",
    "TriangleSetup", "PrimitiveBinning", "CoarseRasterizer", "FineRasterizer", "PixelShader", "ROP",
)  # fmt: skip
COPIES = {"BlockSums": 4096, "Sum": 4, "PrimitiveCount": 4}  # bytes
LAST = "StreamingToFrameBuffer"  # outside of the graph, after the window's buffer is mapped
WAITS = {"PrimitiveBinning": ("PrimitiveCount",), "CoarseRasterizer": ("PrimitiveBinning", "TriangleSetup")}
MAPPING_CALLS = 4  # assumed: to map and to unmap, the driver submits to both of its contexts
FRAME = f"bunny {WIDTH}x{HEIGHT}"
FITTED = ("gpu_time_rasterize_pipeline", "default_stream")  # the cell that gives the gap between calls
GAP = "zhang2025: microseconds between calls"
SAME = {"gpu_time": "gpu_time_rasterize_pipeline", "total_frame_time": "cpu_time"}  # ours: one number in two rows


def nodes(times: dict[str, float], machine: Machine) -> list[Node]:
    """All launches, copies and clears of a frame but the last, with what they wait for."""
    bandwidth = machine.memory.dram_gb_per_s * machine.memory.dram_efficiency * 1e3  # bytes a microsecond
    copied = {name: machine.launch.kernel_us + size / bandwidth for name, size in COPIES.items()}
    clears = [
        Node(name, machine.launch.kernel_us + size / bandwidth, shares=True) for name, (size, _) in CLEARS.items()
    ]
    stages = []
    for i, stage in enumerate(ORDER):
        before = WAITS.get(stage, ORDER[i - 1 : i])
        cleared = tuple(name for name, (_, target) in CLEARS.items() if target == stage)
        stages.append(Node(stage, copied[stage] if stage in copied else times[stage], (*cleared, *before)))
    return clears + stages


def run(progress: Callable[[str], None]) -> Result:
    """Price the frame both ways."""
    scene = bunny()
    if scene is None:
        warning = "bunny_5k is not on the scene path (TILESTAMP_SCENES): nothing was drawn"
        return Result(
            name="zhang2025-graph",
            title="Stream against graph",
            source=SOURCE,
            cells=[],
            figures=[],
            notes=[],
            warnings=[warning],
        )
    machine = load_machine(MACHINE)
    progress(MACHINE)
    stages = draw(scene, MACHINE).stages.milliseconds
    times = {str(stage): 1e3 * float(ms) for stage, ms in stages.items()}
    frame = nodes(times, machine)
    last = Node(LAST, times[LAST])
    asked = {str(row["metric"]): row for row in published("graph").to_dict("records")}
    busy = on_stream([*frame, last], 0.0, 0.0).gpu_us
    between = (1e3 * float(asked[FITTED[0]][f"{FITTED[1]}_ms"]) - busy) / (len(frame) + 1)
    gap = Fitted(GAP, between, (" | ".join((FRAME, "zhang2025-graph", *FITTED)),)).value
    stream = on_stream([*frame, last], gap, 0.0).gpu_us
    graph = as_graph(frame, gap, 0.0)
    mapping = MAPPING_CALLS * gap
    ended = graph.gpu_us + mapping + times[LAST]
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
            f"{CLEARS['FragmentStream'][0] / 1e6:.0f} MB of them the fragment stream; the rest is gaps."
        ),
        (
            f"The only constant: {gap:.0f} us from the end of a call to the start of one that waits for it, on "
            f"the stream ({len(frame) + 1} calls) as in the graph ({len(graph.path)} on the path). It is far above the "
            f"{machine.launch.stream_us} us measured on Linux; presumably Windows hands calls over in batches."
        ),
        f"Assumed: mapping and unmapping the window's buffer costs {MAPPING_CALLS} such gaps.",
    ]
    bars = _breakdown(table, graph.path, gap, mapping)
    figure = Figure(
        "breakdown",
        lambda path: stacked_bars(bars, path, title="A frame on the stream, and a graph's critical path", y_label="ms"),
    )
    return Result(
        name="zhang2025-graph",
        title="Stream against graph",
        source=SOURCE,
        cells=cells,
        figures=[figure],
        notes=notes,
        tables={"graph": table},
    )


def _table(frame: list[Node], path: tuple[str, ...]) -> pd.DataFrame:
    """One row a node."""
    return pd.DataFrame(
        [
            {
                "node": node.name,
                "kind": "clear" if node.name in CLEARS or node.name in COPIES else "kernel",
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
