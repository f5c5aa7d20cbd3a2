"""One batch of a macro tile: its entries, which tiles each of them reaches, and the walk along those of a tile."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023 import blend_walk as group
from tilestamp.simulator.stages.kerbl2023.blend import load_entry
from tilestamp.simulator.stages.kerbl2023.blend_block import CONIC_BYTES, INDEX_BYTES, POSITION_BYTES, Room
from tilestamp.simulator.stages.kerbl2023.blend_pixels import COLOURS, place
from tilestamp.simulator.stages.kerbl2023.blend_step import ENTRY, LANES, LAST, RED, TRANSMITTANCE
from tilestamp.simulator.stages.kerbl2023.blend_walk import BOX, visible_reach, walk
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.tile_rules import SQUARE, cut_off, tile_columns, tile_rows
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.stages.kerbl2023.two_scale_events import BatchEvent

COLUMNS, LINES = 8, 4  # tiles of a macro tile
MACRO = COLUMNS * LINES
MINI, DRAIN = 32, 64  # entries: of a warp's mask, between two looks at who is done
WARPS = 10
PARTIAL = 4  # words of a pixel: colour, transmittance
_E = BatchEvent


class Scratch(NamedTuple):
    """Working memory of one thread of this computer, beside that of the blending loop."""

    entries: NDArray[np.float32]  # of one tile
    boxes: NDArray[np.int32]
    order: NDArray[np.int64]  # their numbers in the batch
    shown: NDArray[np.uint32]  # pixels on the screen, a bit each
    masks: NDArray[np.int64]  # tiles of each entry of the batch, a bit each
    reach: NDArray[np.float32]
    warps: NDArray[np.int64]  # (WARPS, 4): load, trips, masks read, tiles


@kernel(lent=True)
def load(first: int, count: int, listed: Any, out: Projected, colours: Any, reach: Any, room: Room) -> None:
    """Gather the entries of a batch."""
    for k in range(count):
        i = listed[first + k]
        visible_reach(out.conics[i], reach)
        load_entry(i, out, colours, reach, room.entries[k], room.boxes[k])


@kernel(lent=True)
def tile_mask(i: int, out: Projected, rule: int, left: int, top: int, tiles: Tiles) -> int:
    """Tiles of a macro tile that list a Gaussian, a bit each; ``left`` and ``top`` are the first ones."""
    conic, x, y, radius = out.conics[i], out.positions[i, 0], out.positions[i, 1], out.radii[i]
    reach = cut_off(conic) if rule != SQUARE else (np.float32(0), np.float32(0), np.float32(0))
    first_row, last_row = tile_rows(rule, x, y, radius, reach, tiles)
    mask = 0
    for row in range(max(first_row, top), min(last_row, top + LINES - 1) + 1):
        first, last = tile_columns(rule, row, x, y, radius, reach, conic, tiles)
        for column in range(max(first, left), min(last, left + COLUMNS - 1) + 1):
            mask |= 1 << ((row - top) * COLUMNS + column - left)
    return mask


@kernel(lent=True)
def gather_sectors(first: int, count: int, listed: Any, warp: int, segment: int, stamps: Any) -> int:
    """Transactions of the loads of a batch: indices twice, positions, conics, and colours, which lie as conics do."""
    sectors = 0
    for start in range(0, count, warp):
        end = min(start + warp, count)
        low, high = (first + start) * INDEX_BYTES, (first + end) * INDEX_BYTES - 1
        sectors += 2 * (high // segment - low // segment + 1)
        for k in range(start, end):
            i = np.int64(listed[first + k])
            for size, weight, touched in ((POSITION_BYTES, 1, stamps[0]), (CONIC_BYTES, 2, stamps[1])):
                sectors += weight * (touched[i * size // segment] != first + start + 1)
                touched[i * size // segment] = first + start + 1
    return sectors


@kernel(lent=True)
def blend_tile(
    tiles: Tiles, tile: int, count: int, before: int, room: Room, own: Scratch, values: Any, lasts: Any
) -> bool:
    """Blend the entries of one tile, whose numbers are ``own.order``; gives whether all pixels were done."""
    for k in range(count):
        for j in range(ENTRY):
            own.entries[k, j] = room.entries[own.order[k], j]
        for j in range(BOX):
            own.boxes[k, j] = room.boxes[own.order[k], j]
    pixels = tiles.tile_x * tiles.tile_y
    rectangle = place(tile, tiles, 0, pixels, room)
    numbers, totals = room.state.view(np.int32), room.totals[0, 0]
    for part in range(len(room.alive)):
        own.shown[part] = room.alive[part]
    totals[:] = 0
    walk(
        own.entries, own.boxes, count, room.state, numbers, room.alive, rectangle, DRAIN, room.rounds[0, 0], room.marks,
        room.uses, np.uint32(1), totals, np.int64(0),
    )  # fmt: skip
    for lane in range(pixels):
        done = (own.shown[lane // LANES] & ~room.alive[lane // LANES]) >> np.uint32(lane % LANES) & np.uint32(1)
        for j in range(COLOURS):
            values[lane, j] = room.state[RED + j, lane]
        values[lane, COLOURS] = -room.state[TRANSMITTANCE, lane] if done else room.state[TRANSMITTANCE, lane]
        last = numbers[LAST, lane]
        lasts[lane] = before + own.order[last - 1] + 1 if last else 0
    living = np.uint32(0)
    for part in range(len(room.alive)):
        living |= room.alive[part]
    done_all: bool = living == 0
    return done_all


@kernel(lent=True)
def count_tile(count: int, minis: int, done: bool, slots: int, room: Room, own: Scratch, row: Any) -> None:
    """Events of one tile; the warp that is free first takes it, as warps draw from the queue in order."""
    totals = room.totals[0, 0]
    trips = min(count, (totals[group.TRIPS] + DRAIN - 1) // DRAIN * DRAIN)
    scanned = own.order[trips - 1] // MINI + 1 if done and trips % DRAIN == 0 else minis
    row[_E.TILES] += 1
    row[_E.MASKS_READ] += scanned
    row[_E.DRAINS] += (trips + DRAIN - 1) // DRAIN
    row[_E.TRIPS] += trips
    row[_E.EVALUATIONS] += totals[group.EVALUATIONS]
    row[_E.BLENDED] += totals[group.BLENDED]
    row[_E.STOPPED] += totals[group.STOPPED]
    free = 0
    for k in range(1, WARPS):
        if own.warps[k, 0] < own.warps[free, 0]:
            free = k
    own.warps[free, 0] += trips * slots + scanned
    own.warps[free, 1] += trips
    own.warps[free, 2] += scanned
    own.warps[free, 3] += 1


@kernel(lent=True)
def count_batch(count: int, slots: int, pixels: int, sectors: int, segment: int, own: Scratch, row: Any) -> None:
    """Events of one batch, from those of its tiles."""
    minis, slowest = (count + MINI - 1) // MINI, 0
    for k in range(1, WARPS):
        if own.warps[k, 0] > own.warps[slowest, 0]:
            slowest = k
    row[_E.WARPS], row[_E.BLOCKS], row[_E.ENTRIES] = WARPS, 1, count
    row[_E.MINI_BATCHES], row[_E.MASK_ROWS], row[_E.MASK_TESTS] = minis, minis * LINES, count * MACRO
    row[_E.MASK_ROUNDS] = (minis + WARPS - 1) // WARPS
    row[_E.TILE_STEPS], row[_E.STEPS] = row[_E.TILES] * slots, row[_E.TRIPS] * slots
    row[_E.IDLE_LANES] = row[_E.TRIPS] * pixels - row[_E.EVALUATIONS]
    row[_E.SLOWEST_TRIPS], row[_E.SLOWEST_STEPS] = own.warps[slowest, 1], own.warps[slowest, 1] * slots
    row[_E.SLOWEST_MASKS], row[_E.SLOWEST_TILES] = own.warps[slowest, 2], own.warps[slowest, 3]
    row[_E.PARTIAL_BYTES] = row[_E.TILES] * pixels * 4 * PARTIAL
    row[_E.LOAD_TRANSACTIONS] = sectors
    row[_E.STORE_TRANSACTIONS] = row[_E.PARTIAL_BYTES] // segment + 1  # and the tiles that have one
    row[_E.LOAD_BYTES] = sectors * segment
    row[_E.STORE_BYTES] = row[_E.STORE_TRANSACTIONS] * segment
