"""H200, Zhang 2025: the author's kernels beside ours, on the same inputs, and his frames on a stream and as a graph.

Every kernel and clear of a frame without a texture, and of one with (``textured_inputs``), drawn with the author's own
faults: whole blocks of tiles, and Hi-Z without a margin. What of a frame is neither kernel nor clear is gaps between
them: two constants, fitted to the frames of two scenes.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.harness.result import Result
from tilestamp.experiments.silicon.textured_compare import FRAME_TIME, Drawn, by_kernel, cells, entry, rows, sentences
from tilestamp.experiments.silicon.textured_inputs import VARIABLE, Measured, measured_scenes, read_measured
from tilestamp.experiments.zhang2025.graph import nodes
from tilestamp.models.errors import MissingInputError
from tilestamp.models.fitted import Fitted
from tilestamp.models.launch_graph import as_graph, on_stream
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.zhang2025.frame_clears import cleared_bytes

if TYPE_CHECKING:
    import pandas as pd

SLOW = True  # draws every measured frame

NAME = "silicon-textured_binned"
TITLE = "H200, Zhang 2025's kernels, model against machine"
SOURCE = f"One NVIDIA H200, 2026-11-29: the folder that {VARIABLE} names"
KERNELS = {"PrimitiveCompaction": "PrimitiveCompactionKernel", "FineRasterizer": "FineRasterizerWIP"}  # his other names
CONFIGS = {"stream": False, "stream_textured": True}  # has a texture
SPAN = "us_span"  # first start to last end
GAPS = {  # microseconds between nodes
    "stream": Fitted("zhang2025 on an H200: gap on a stream", 1.85, ("zh_Duck_fit | silicon-textured_binned | *",)),
    "graph": Fitted("zhang2025 on an H200: gap in a graph", 1.0, ("zh_Duck_fit | silicon-textured_binned | *",)),
}


def run(progress: Callable[[str], None]) -> Result:
    """Draw and price every measured frame."""
    import pandas as pd

    try:
        names = measured_scenes("zh")
    except MissingInputError as missing:
        return Result(name=NAME, title=TITLE, source=SOURCE, cells=[], warnings=[str(missing)])
    found: list[dict[str, Any]] = []
    for name in names:
        measured = read_measured(name)
        for config, textured in CONFIGS.items():
            progress(f"{name} {config}")
            drawn = draw(measured, textured=textured)
            found += rows(measured, Drawn(config, drawn, [kernel_name(measured, drawn, work) for work in range(len(drawn.frame.works))]))
            found += frames(measured, drawn, config)
    table = pd.DataFrame(found)
    return Result(
        name=NAME,
        title=TITLE,
        source=SOURCE,
        cells=cells(table),
        notes=[*sentences(table), *_events(names)],
        tables={"all": table, "kernels": by_kernel(table)},
    )
