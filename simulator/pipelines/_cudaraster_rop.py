"""Fine raster of cudaraster with another ROP than the published one: a program, or lists of fragments."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.laine2011.coarse_raster import TileQueues
from tilestamp.simulator.stages.laine2011.fragment_lists import LAYOUTS, keep_fragments
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers
from tilestamp.simulator.stages.laine2011.programmable_rop import needs_depth, programmable_rop
from tilestamp.simulator.stages.laine2011.resolve_lists import resolve_lists
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup


def reads_depth(blend: str, lists: str) -> bool:
    """Whether the ROP reads depths, though fine raster does not test them."""
    return lists in LAYOUTS or needs_depth(blend)


def draw_by(
    execute: Executor,
    setup: Setup,
    queues: TileQueues,
    size: tuple[int, int],
    simt: Simt,
    colors: NDArray[np.float32],
    *,
    blend: str,
    layers: int,
    lists: str,
    room: int,
) -> StageResult[FrameBuffers]:
    """Draw all tiles by the program ``blend``, or where ``lists`` names a layout by lists and a pass that resolves."""
    inputs = setup, queues.starts, queues.entries, queues.active, *size, simt
    for layout in LAYOUTS:
        if layout == lists:
            (buffers, kept), drawn, facts = execute(keep_fragments, *inputs, layout=layout, room=room, colors=colors)
            _, resolved, _ = execute(resolve_lists, kept, buffers.color[0], simt)
            return StageResult(buffers, (*drawn, *resolved), facts)
    return execute(programmable_rop, *inputs, program=blend, layers=layers, colors=colors)
