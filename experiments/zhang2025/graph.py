"""Zhang 2025, CUDA graph impact: the frame on one stream against a graph with parallel branches."""

from collections.abc import Callable

import pandas as pd

from experiments.result import Cell, Result, Status
from experiments.zhang2025.setting import HEIGHT, SOURCE, WIDTH, bunny, draw, published
from models.launch_graph import Node, as_graph, on_stream
from models.machine import Machine, load_machine

SLOW = True  # with what it needs compiled, more than the first run should take

MACHINE = "ga104"
PIXELS = WIDTH * HEIGHT
TRIANGLES = 4968
# What he clears or copies in each frame, in bytes, and the stage that waits for it (his graph).
CLEARS = {
    "PrimitiveStream": (4 * TRIANGLES * 112, "PrimitiveAssembly"),
    "SubTriangleCounter": (4, "PrimitiveAssembly"),
    "SubQueuePrimCount": (4 * 2046 * 256, "PrimitiveBinning"),
    "TrunkAllocator": (4, "PrimitiveBinning"),
    "TileQueuePrimCount": (4 * 256 * 256 * 4, "CoarseRasterizer"),
    "TileTrunkAllocator": (4, "CoarseRasterizer"),
    "HiZ": (4 * 256 * 256, "CoarseRasterizer"),
    "FragmentStream": (48 * 4 * PIXELS, "FineRasterizer"),
    "DepthBuffer": (4 * PIXELS, "FineRasterizer"),
    "QuadAllocator": (4, "FineRasterizer"),
    "PixelBaseIdx": (4 * PIXELS, "PixelShader"),
    "RenderTarget": (16 * PIXELS, "ROP"),
}
ORDER = (
    "VertexFetchAndShading", "PrimitiveAssembly", "PrimitiveCompaction", "TriangleSetup", "PrimitiveBinning",
    "CoarseRasterizer", "FineRasterizer", "PixelShader", "ROP", "StreamingToFrameBuffer",
)  # fmt: skip
WAITS = {"PrimitiveBinning": "PrimitiveCompaction"}  # instead of the stage before
CALLS = len(CLEARS) + len(ORDER) + 3  # on the stream, with three copies back that size the next launch
FITTED = {("gpu_time_rasterize_pipeline", "default_stream"), ("gpu_time", "cuda_graph")}  # a call, a mapping


def nodes(times: dict[str, float], machine: Machine) -> list[Node]:
    """All launches, copies and clears of a frame, with what they wait for."""
    bandwidth = machine.memory.dram_gb_per_s * machine.memory.dram_efficiency * 1e3  # bytes a microsecond
    clears = [Node(name, machine.launch.kernel_us + size / bandwidth) for name, (size, _) in CLEARS.items()]
    stages = []
    for i, stage in enumerate(ORDER):
        before = WAITS.get(stage, ORDER[i - 1] if i else None)
        both = ("TriangleSetup",) if stage == "CoarseRasterizer" else ()
        waits = tuple(name for name, (_, target) in CLEARS.items() if target == stage)
        stages.append(Node(stage, times[stage], (*waits, *([before] if before else ()), *both)))
    return clears + stages


def _status(metric: str, column: str) -> Status:
    return "fitted" if (metric, column) in FITTED else "predicted"


def run(progress: Callable[[str], None]) -> Result:
    """Price the frame both ways."""
    scene = bunny()
    if scene is None:
        warning = "bunny_5k is not on the scene path (TILESTAMP_SCENES): nothing was drawn"
        return Result("zhang2025-graph", "Stream against graph", SOURCE, [], [], [], [warning])
    machine = load_machine(MACHINE)
    progress(MACHINE)
    stages = draw(scene, MACHINE).stages.milliseconds
    frame = nodes({str(stage): 1e3 * float(ms) for stage, ms in stages.items()}, machine)
    stream = on_stream(frame, machine.launch.stream_us, machine.launch.sync_us)
    graph = as_graph(frame, machine.launch.graph_us, machine.launch.sync_us)
    asked = {str(row["metric"]): row for row in published("graph").to_dict("records")}
    wait = 1e3 * float(asked["gpu_time_rasterize_pipeline"]["default_stream_ms"]) - stream.gpu_us
    mapping = 1e3 * float(asked["gpu_time"]["cuda_graph_ms"]) - graph.gpu_us
    pairs = {
        "gpu_time_rasterize_pipeline": (stream.gpu_us + wait, graph.gpu_us),
        "gpu_time": (stream.gpu_us + wait, graph.gpu_us + mapping),
        "cpu_time": (stream.cpu_us + wait + mapping, graph.cpu_us + mapping),
        "total_frame_time": (stream.cpu_us + wait + mapping, graph.cpu_us + mapping),
    }
    cells = [
        Cell(metric, column, "ms", float(asked[metric][f"{column}_ms"]), us / 1e3, _status(metric, column), aim=0.5)
        for metric, both in pairs.items()
        for column, us in zip(("default_stream", "cuda_graph"), both, strict=True)
    ]
    table = pd.DataFrame(
        [
            {"node": n.name, "gpu_us": n.gpu_us, "after": " ".join(n.after), "critical": n.name in graph.path}
            for n in frame
        ]
    )
    cleared = sum(n.gpu_us for n in frame if n.name in CLEARS)
    notes = [
        f"Critical path of the graph: {' > '.join(graph.path)}.",
        (
            f"Clears take {cleared / 1e3:.2f} ms of the stream; side by side they still share one memory, which this "
            "graph does not model, so its clears are too cheap where several overlap."
        ),
        (
            f"Fitted: {wait / CALLS:.0f} us that each of {CALLS} calls on the stream keeps the GPU idle beyond the "
            f"machine's launch time, and {mapping:.0f} us to map and unmap the window's buffer."
        ),
    ]
    return Result("zhang2025-graph", "Stream against graph", SOURCE, cells, [], notes, tables={"graph": table})
