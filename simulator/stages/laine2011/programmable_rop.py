"""Fine raster with a program in its ROP: blending by a function of the user (Laine & Karras 2011, section 8).

Everything in front of the ROP is fine raster without depth test: the same lists, masks, rounds of 32 fragments and
shading, and the same conflict resolution. Lanes whose fragments lie on one pixel take turns in input order: a round has
as many steps as its busiest pixel has fragments, and each step runs the program once for the lanes that have their
turn. What a pixel keeps lies in shared memory, so that a program of many words leaves room for fewer warps.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.blend_programs import (
    BUILT_IN,
    K_BUFFER,
    NEAREST,
    BlendProgram,
    blend,
    compiled,
    find_program,
    resolved,
    start_pixel,
    words_of,
)
from tilestamp.simulator.stages.laine2011.fine_raster_queue import PIXELS, TILE, Draw, FineRasterEvent
from tilestamp.simulator.stages.laine2011.fine_raster_work import fine_work
from tilestamp.simulator.stages.laine2011.fragments import Fragments, events_with, front
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

_LAYERED = ("LAYER_STEPS", "LAYER_LANES", "RESOLVE_LAYERS")
_CLASSES = ("FP32", "INT32", "MUL32", "SFU", "CONTROL", "SHARED", "LANES")
ProgramEvent = events_with("ProgramEvent", __name__, (*_LAYERED, *_CLASSES))
"""Layers gone through in steps of the ROP, and when the tile is done, by half of its pixels at a time; and the
instructions of the user's function, which no mix can know."""


def needs_depth(program: str) -> bool:
    """Whether a program reads the depth of a fragment: of the library the layered ones, and the user's."""
    return program not in BUILT_IN[:NEAREST]


@kernel
def _blend_part(
    part: int,
    parts: int,
    active: Any,
    fragments: Fragments,
    keys: Any,
    program: int,
    words: int,
    draw: Draw,
    image: Any,
) -> None:
    """Run a program of the library over a share of the active tiles."""
    pixels = np.empty((PIXELS, words), np.int64)
    first, last = active.size * part // parts, active.size * (part + 1) // parts
    _blend_tiles(
        first, last, borrow(active), borrow(fragments), borrow(keys), program, borrow(pixels), draw, borrow(image)
    )
    pixels[0, 0] = 0  # the owner lives to here


@kernel(lent=True)
def _blend_tiles(
    first: int,
    last: int,
    active: Any,
    fragments: Fragments,
    keys: Any,
    program: int,
    pixels: Any,
    draw: Draw,
    image: Any,
) -> None:
    for a in range(first, last):
        for p in range(PIXELS):
            start_pixel(pixels[p], program, draw.clear_color)
        for i in range(fragments.first[a], fragments.first[a + 1]):
            blend(pixels[fragments.pixel[i]], program, fragments.color[i], fragments.depth[i], keys[i])
        for p in range(PIXELS):
            x, y = active[a] % draw.tiles_x * TILE + 7 - (p & 7), active[a] // draw.tiles_x * TILE + (p >> 3)
            image[y, x] = resolved(pixels[p], program)


def fragment_keys(setup: Setup, fragments: Fragments, active: NDArray[np.int32], tiles: int) -> NDArray[np.int64]:
    """A number for each fragment that no other has: its triangle, and its pixel."""
    tile = np.repeat(active.astype(np.int64), np.diff(fragments.first))
    triangle = setup.inputs[setup.records[fragments.slot]].astype(np.int64)
    keys: NDArray[np.int64] = (triangle * tiles + tile) * PIXELS + fragments.pixel
    return keys


def programmable_rop(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    program: str | BlendProgram,
    layers: int,
    colors: NDArray[np.float32],
) -> StageResult[FrameBuffers]:
    """Draw the queued triangles of all active tiles, cleared to black, blending by a program.

    Parameters
    ----------
    setup, tile_starts, tile_entries, active_tiles, width, height, simt, colors
        As fine raster takes them; release 1.1, one sample a pixel, no depth test.
    program : str or BlendProgram
        One of ``BUILT_IN``, ``module:name`` of a function or a program of the user's, or that program.
    layers : int
        Fragments that a k-buffer keeps, samples of stochastic transparency.

    Returns
    -------
    outputs : FrameBuffers
        Depths stay clear.
    works : one, a row an active tile

    Raises
    ------
    TilestampError
        For a program that does not exist, or that Numba cannot compile or run.
    """
    lists = tile_starts, tile_entries, active_tiles
    name = program if isinstance(program, str) else "user"
    theirs = None if name in BUILT_IN else find_program(program) if isinstance(program, str) else program
    code = BUILT_IN.index(name) if theirs is None else -1
    words = words_of(code, layers) if theirs is None else theirs.words
    draw, buffers, fragments, rows = front(setup, lists, width, height, simt, colors, depth=needs_depth(name))
    keys = fragment_keys(setup, fragments, active_tiles, len(tile_starts) - 1)
    if theirs is None:
        for_parts(
            _blend_part, parts_of(len(active_tiles), 32),
            active_tiles, fragments, keys, code, words, draw, buffers.color[0],
        )  # fmt: skip
    else:
        _blend_by(theirs, fragments, keys, active_tiles, draw, buffers.color[0])
    operations = {} if theirs is None else theirs.operations
    work = fine_work(
        _with_program(rows, layers if code >= K_BUFFER else 0, operations), setup, tile_entries, width, height, simt,
        release="1.1", samples=1, mode=f"blend {name}" if theirs is None else "blend depth", words=words,
    )  # fmt: skip
    return StageResult(buffers, (replace(work, events=ProgramEvent),))


def _with_program(rows: NDArray[np.int64], layers: int, operations: dict[str, float]) -> NDArray[np.int64]:
    """Add what a program does in each step of the ROP to the rows of fine raster."""
    steps, lanes = rows[:, FineRasterEvent.ROP_STEPS], rows[:, FineRasterEvent.ROP_LANES]
    layered = [layers * steps, layers * lanes, np.full(len(rows), 2 * layers)]
    executed = [np.rint(operations.get(name.lower(), 0.0) * steps).astype(np.int64) for name in _CLASSES[:-1]]
    active = np.rint(sum(operations.values()) * lanes).astype(np.int64)
    return np.column_stack([rows, *layered, *executed, active])


def _blend_by(
    program: BlendProgram,
    fragments: Fragments,
    keys: NDArray[np.int64],
    active: NDArray[np.int32],
    draw: Draw,
    image: NDArray[np.uint32],
) -> None:
    """Run the user's function, tile by tile."""
    run = compiled(program.apply)
    for a, tile in enumerate(active):
        pixels = np.zeros((PIXELS, program.words), np.int64)
        pixels[:, 0] = draw.clear_color
        here = slice(fragments.first[a], fragments.first[a + 1])
        try:
            run(pixels, fragments.pixel[here], fragments.color[here], fragments.depth[here], keys[here])
        except (NumbaError, TypeError, IndexError) as error:
            raise TilestampError(
                f"blend {program.apply.__name__}: Numba compiles a function of (pixel, color, depth, key) that has"
                f" {program.words} words a pixel; this is none"
            ) from error
        x, y = tile % draw.tiles_x * TILE, tile // draw.tiles_x * TILE
        image[y : y + TILE, x : x + TILE] = (pixels[:, 0] & 0xFFFFFFFF).reshape(TILE, TILE)[:, ::-1]
