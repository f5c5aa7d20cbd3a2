"""Pixels of the blending loop: set up before a warp walks along a list, stored behind."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.blend_block import Room
from tilestamp.simulator.stages.kerbl2023.blend_step import LANES, LAST, RED, TRANSMITTANCE, X, Y
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.stages.laine2011.exact import fma

COLOURS, PLANES = 3, 5  # channels; words that a pixel stores
_E = BlendEvent


class Pixels(NamedTuple):
    """What the pixels show.

    Parameters
    ----------
    colours : ndarray, (H, W, 3), float32
        Blended over the background; neither clipped nor rounded.
    transmittance : ndarray, (H, W), float32
        What is left of the background.
    reached : ndarray, (H, W), uint32
        Place of the last entry that was blended in the list of its tile, from 1; 0 where there is none.
    uses : ndarray, (P, 2), int32
        Of each entry of all lists the pixels, and the steps of warps, that blend it; (0, 2) where nothing was counted.
    """

    colours: NDArray[np.float32]
    transmittance: NDArray[np.float32]
    reached: NDArray[np.uint32]
    uses: NDArray[np.int32]


def new_pixels(tiles: Tiles, entries: int = 0) -> Pixels:
    """Allocate the pixels of a screen; ``entries`` whose uses are counted."""
    shape = (tiles.height, tiles.width)
    return Pixels(
        np.empty((*shape, 3), np.float32), np.empty(shape, np.float32), np.empty(shape, np.uint32),
        np.zeros((entries, 2), np.int32),
    )  # fmt: skip


@kernel(lent=True)
def place(tile: int, tiles: Tiles, first: int, end: int, room: Room) -> Any:
    """Set up pixels of a tile: coordinates, who is on the screen; gives the rectangle around them."""
    left, top = tile % tiles.columns * tiles.tile_x, tile // tiles.columns * tiles.tile_y
    room.state[:] = 0
    room.alive[:] = 0
    p = first
    while p < end:
        x, y = left + p % tiles.tile_x, top + p // tiles.tile_x
        run = min(left + tiles.tile_x - x, end - p)
        for lane in range(p - first, p - first + run):
            room.state[X, lane], room.state[Y, lane] = x, y
            room.state[TRANSMITTANCE, lane] = 1
            if x < tiles.width and y < tiles.height:
                room.alive[lane // LANES] |= np.uint32(1) << np.uint32(lane % LANES)
            x += 1
        p += run
    x, last = left + first % tiles.tile_x, min(end - first, tiles.tile_x) - 1
    return x, x + last, top + first // tiles.tile_x, top + (end - 1) // tiles.tile_x


@kernel(lent=True)
def store(
    tile: int, tiles: Tiles, first: int, end: int, segment: int, background: Any, room: Room, pixels: Pixels, row: Any
) -> None:
    """Store the pixels of a warp; count the sectors of each row of pixels by itself."""
    left, top = tile % tiles.columns * tiles.tile_x, tile // tiles.columns * tiles.tile_y
    lasts = room.state.view(np.int32)
    stored, p = 0, first
    while p < end:
        x, y = left + p % tiles.tile_x, top + p // tiles.tile_x
        run = min(left + tiles.tile_x - x, end - p)
        shown = max(min(run, tiles.width - x), 0) if y < tiles.height else 0
        for i in range(shown):
            lane = p - first + i
            transmittance = room.state[TRANSMITTANCE, lane]
            for k in range(COLOURS):
                pixels.colours[y, x + i, k] = fma(background[k], transmittance, room.state[RED + k, lane])
            pixels.transmittance[y, x + i] = transmittance
            pixels.reached[y, x + i] = lasts[LAST, lane]
        if row is not None and shown:
            for plane in range(PLANES):
                word = max(plane - 2, 0) * tiles.width * tiles.height + y * tiles.width + x
                row[_E.STORE_TRANSACTIONS] += ((word + shown) * 4 - 1) // segment - word * 4 // segment + 1
        stored += shown
        p += run
    if row is not None:
        row[_E.PIXELS] += stored
        row[_E.PIXEL_WARPS] += stored > 0
