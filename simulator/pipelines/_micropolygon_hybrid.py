"""The hybrid of Eisenacher & Loop 2010 (table 3): the diced grids go through the fixed-function rasterizer."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.stages.eisenacher2010.dice import Grids
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import BACKGROUND, GRID_SIDE, QUADS
from tilestamp.simulator.stages.hardware import hardware_grids


def draw_grids(execute: Executor, grids: Grids, width: int, height: int, facts: dict[str, Any]) -> Frame:
    """Draw diced grids by fixed function; a quad takes the colour of its first vertex, which is a pixel away at most.

    Parameters
    ----------
    execute : Executor
    grids : Grids
    width, height : int
        Pixels.
    facts : dict
        Of the stages before.
    """
    clip = np.ones((len(grids.vertices), GRID_SIDE, GRID_SIDE, 4), np.float32)
    screen = grids.vertices.reshape(clip.shape)
    clip[..., 0] = screen[..., 0] * np.float32(2 / width) - np.float32(1)
    clip[..., 1] = np.float32(1) - screen[..., 1] * np.float32(2 / height)
    clip[..., 2] = screen[..., 2]
    drawn, _, found = execute(hardware_grids, clip, width, height)
    ids = drawn.ids[::-1]  # its row 0 is the bottom row
    image = _colors(grids.vertices, ids)
    return Frame(image, drawn.depth[::-1], execute.works, facts={**facts, **found})


def _colors(vertices: NDArray[np.float32], ids: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Colour of the first vertex of each pixel's quad."""
    quad = ids % QUADS
    packed = np.full(ids.shape, BACKGROUND, np.uint32)
    seen = ids >= 0
    first = quad + quad // (GRID_SIDE - 1)
    packed[seen] = vertices.view(np.uint32)[ids[seen] // QUADS, first[seen], 3]
    return np.ascontiguousarray(packed[..., None].view(np.uint8)[..., :3])
