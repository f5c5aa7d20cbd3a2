"""Windows of a warp's pixels: Gaussians sorted by their depth along each ray, the nearest blended first."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.blend_block import Block, Room
from tilestamp.simulator.stages.kerbl2023.blend_pixels import COLOURS, place
from tilestamp.simulator.stages.kerbl2023.blend_step import LANES, LAST, OPAQUE, RED, TRANSMITTANCE, X, Y, blend_step
from tilestamp.simulator.stages.kerbl2023.events import ResortEvent
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.stages.laine2011.exact import fma

_ONE = np.float32(1)
_E = ResortEvent


class Rays(NamedTuple):
    """Matrices of all Gaussians, (N, 12), float32, and what makes a ray of a pixel."""

    rows: NDArray[np.float32]
    tan_x: np.float32
    tan_y: np.float32


class Windows(NamedTuple):
    """Windows of the pixels of a warp."""

    depths: NDArray[np.float32]  # (lanes, places + 1)
    alphas: NDArray[np.float32]
    numbers: NDArray[np.int64]  # of the entry, from 1
    filled: NDArray[np.int64]  # (lanes,)
    left: NDArray[np.float32]
    latest: NDArray[np.float32]  # depth of the last blend
    blending: NDArray[np.int64]  # Gaussian that a lane blends in this step, -1 where none


@kernel(lent=True)
def depth_along(ray: Any, x: int, y: int, tiles: Tiles, rays: Rays) -> Any:
    """Depth at which a Gaussian is densest along the ray of a pixel."""
    dx = (np.float32(2 * x + 1) / np.float32(tiles.width) - _ONE) * rays.tan_x
    dy = (np.float32(2 * y + 1) / np.float32(tiles.height) - _ONE) * rays.tan_y
    above, below = np.float32(0), np.float32(0)
    for k in range(3):
        u = fma(ray[3 * k], dx, fma(ray[3 * k + 1], dy, ray[3 * k + 2]))
        above, below = fma(u, ray[9 + k], above), fma(u, u, below)
    return above / below


@kernel(lent=True)
def _insert(lane: int, depth: Any, alpha: Any, number: int, windows: Windows) -> None:
    """Sort into a window, behind what is as near."""
    at = windows.filled[lane]
    while at > 0 and windows.depths[lane, at - 1] > depth:
        windows.depths[lane, at] = windows.depths[lane, at - 1]
        windows.alphas[lane, at] = windows.alphas[lane, at - 1]
        windows.numbers[lane, at] = windows.numbers[lane, at - 1]
        at -= 1
    windows.depths[lane, at], windows.alphas[lane, at], windows.numbers[lane, at] = depth, alpha, number
    windows.filled[lane] += 1


@kernel(lent=True)
def _blend_nearest(lane: int, first: int, listed: Any, colours: Any, windows: Windows, room: Room, row: Any) -> bool:
    """Blend what is nearest in a window; gives whether the pixel is done."""
    alpha, number = windows.alphas[lane, 0], windows.numbers[lane, 0]
    early = windows.depths[lane, 0] < windows.latest[lane]
    left = windows.left[lane] * (_ONE - alpha)
    if left < OPAQUE:
        row[_E.STOPPED] += 1
        row[_E.DROPPED] += windows.filled[lane] - 1
        windows.filled[lane] = 0
        return True
    i = np.int64(listed[first + number - 1])
    lasts = room.state.view(np.int32)
    for k in range(COLOURS):
        room.state[RED + k, lane] = fma(windows.left[lane], alpha * colours[i, k], room.state[RED + k, lane])
    lasts[LAST, lane] = max(lasts[LAST, lane], number)
    windows.latest[lane], windows.left[lane], windows.blending[lane] = windows.depths[lane, 0], left, i
    row[_E.BLENDED] += 1
    row[_E.EARLY] += early
    windows.filled[lane] -= 1
    for at in range(windows.filled[lane]):
        windows.depths[lane, at] = windows.depths[lane, at + 1]
        windows.alphas[lane, at] = windows.alphas[lane, at + 1]
        windows.numbers[lane, at] = windows.numbers[lane, at + 1]
    return False


@kernel(lent=True)
def _colour_sectors(blending: Any, segment: int, row: Any) -> bool:
    """Count the transactions of the colours of one step, three words a lane; gives whether any lane blends."""
    some = False
    for k in range(COLOURS):
        for lane in range(len(blending)):
            if blending[lane] >= 0:
                some, sector, new = True, (blending[lane] * 12 + 4 * k) // segment, 1
                for other in range(lane):
                    if blending[other] >= 0 and (blending[other] * 12 + 4 * k) // segment == sector:
                        new = 0
                        break
                row[_E.LOAD_TRANSACTIONS] += new
    return some


@kernel(lent=True)
def walk_in_order(
    begin: int, end: int, tile: int, tiles: Tiles, block: Block, first: int, count: int, listed: Any, colours: Any,
    rays: Rays, places: int, windows: Windows, room: Room, red: Any, row: Any,
) -> Any:  # fmt: skip
    """Walk along a list with the pixels of a warp; gives its steps, steps that insert, and steps that blend."""
    rectangle = place(tile, tiles, begin, end, room)
    windows.filled[:], windows.left[:], windows.latest[:] = 0, 1, -np.inf
    living = 0
    for part in range(block.parts):
        living += popcount(np.uint64(room.alive[part]))
    k, inserts, blends = 0, 0, 0
    while k < count and living:
        box = room.boxes[k]
        before = living
        unbounded, inserted = 0, 0
        windows.blending[:] = -1
        if box[0] <= rectangle[1] and box[1] >= rectangle[0] and box[2] <= rectangle[3] and box[3] >= rectangle[2]:
            for part in range(block.parts):
                alive = room.alive[part]
                red[RED], red[TRANSMITTANCE] = 0, 1
                for bit in range(LANES):
                    red[X, bit], red[Y, bit] = room.state[X, part * LANES + bit], room.state[Y, part * LANES + bit]
                seen, _, wild = blend_step(red, red.view(np.int32), 0, alive, room.entries[k], k + 1)
                unbounded += popcount(np.uint64(wild))
                inserted += popcount(np.uint64(seen))
                while seen:
                    bit = lowest_bit(np.uint64(seen))
                    seen = np.uint32(seen & (seen - np.uint32(1)))
                    lane = part * LANES + bit
                    x, y = np.int64(red[X, bit]), np.int64(red[Y, bit])
                    depth = depth_along(rays.rows[listed[first + k]], x, y, tiles, rays)
                    _insert(lane, depth, red[RED, bit], k + 1, windows)
                    if windows.filled[lane] > places and _blend_nearest(
                        lane, first, listed, colours, windows, room, row
                    ):
                        room.alive[part] = np.uint32(room.alive[part] & ~(np.uint32(1) << np.uint32(bit)))
                        living -= 1
            blends += _colour_sectors(windows.blending, block.segment, row)
        row[_E.EVALUATIONS] += before
        row[_E.EXP_LANES] += before - unbounded
        row[_E.EXP_STEPS] += unbounded < before
        row[_E.INSERTED] += inserted
        inserts += inserted > 0
        k += 1
    for _ in range(places):
        windows.blending[:] = -1
        for lane in range(end - begin):
            if windows.filled[lane]:
                _blend_nearest(lane, first, listed, colours, windows, room, row)
        blends += _colour_sectors(windows.blending, block.segment, row)
    for lane in range(end - begin):
        room.state[TRANSMITTANCE, lane] = windows.left[lane]
    return k, inserts, blends
