"""A block of the blending loop and its machine, and what its rows are made of."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import popcount
from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.kerbl2023 import blend_walk as group
from tilestamp.simulator.stages.kerbl2023.blend_step import LANES
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles

INDEX_BYTES, POSITION_BYTES, CONIC_BYTES = 4, 8, 16
BLEND_WEIGHT = 2  # a step that blends takes about three times as long as one that does not
_E = BlendEvent


class Block(NamedTuple):
    """A block and its machine, as kernels take it."""

    threads: int
    pixels: int  # a thread
    warp: int
    warps: int
    segment: int  # bytes of the smallest transaction
    parts: int  # of 32 lanes in a warp
    masked: int  # 1 where warps skip entries whose box no pixel that is not done lies in


class Room(NamedTuple):
    """Working memory of one thread of this computer."""

    entries: NDArray[np.float32]  # (longest list, ENTRY)
    boxes: NDArray[np.int32]
    state: NDArray[np.float32]  # (ROWS, lanes)
    alive: NDArray[np.uint32]
    rounds: NDArray[np.int64]  # (warps, pixels a thread, rounds, PER_ROUND)
    totals: NDArray[np.int64]  # (warps, pixels a thread, TOTALS)
    marks: NDArray[np.uint32]  # (longest list,): the warps that blend an entry, a bit each
    uses: NDArray[np.int64]  # (longest list, 2): pixels and steps that blend an entry
    stamps: NDArray[np.int64]  # (2, sectors of the conics): by which gather a sector was touched last


def block_of(tiles: Tiles, threads: int, simt: Simt, *, mask: bool = False) -> Block:
    """Give the block of a tile."""
    segment = smallest_transaction_bytes(int(simt.coalescing))
    warps = -(-threads // simt.warp)
    return Block(
        threads, tiles.pixels // threads, simt.warp, warps, segment, -(-min(simt.warp, threads) // LANES), int(mask)
    )


@kernel(lent=True)
def gather_sectors(first: int, count: int, listed: Any, block: Block, room: Room) -> int:
    """Transactions of the loads of entries: indices, positions and conics, by warp and round."""
    sectors = 0
    for begin in range(0, count, block.threads):
        for start in range(begin, min(begin + block.threads, count), block.warp):
            end = min(start + block.warp, begin + block.threads, count)
            low, high = (first + start) * INDEX_BYTES, (first + end) * INDEX_BYTES - 1
            sectors += high // block.segment - low // block.segment + 1
            stamp = first + start + 1
            for k in range(start, end):
                i = np.int64(listed[first + k])
                for size, stamps in ((POSITION_BYTES, room.stamps[0]), (CONIC_BYTES, room.stamps[1])):
                    place = i * size // block.segment
                    sectors += stamps[place] != stamp
                    stamps[place] = stamp
    return sectors


@kernel(lent=True)
def count_rounds(count: int, block: Block, room: Room, row: Any) -> None:
    """Rounds of the block and its warps, and in each the warp that the others wait for."""
    longest = 0
    for warp in range(block.warps):
        trips, walked = 0, 0
        for slot in range(block.pixels):
            trips = max(trips, room.totals[warp, slot, group.TRIPS])
            walked = max(walked, room.totals[warp, slot, group.WALKED])
        row[_E.TRIPS] += trips
        row[_E.WARP_BATCHES] += (walked + block.threads - 1) // block.threads
        longest = max(longest, walked)
    row[_E.BATCHES] = (longest + block.threads - 1) // block.threads
    row[_E.ENTRIES] = min(count, row[_E.BATCHES] * block.threads)
    row[_E.LEFT] = row[_E.ENTRIES] < count
    for k in range(row[_E.BATCHES]):
        begin, worst = k * block.threads, -1
        slowest, bit = (0, 0, 0, 0), np.uint32(0)
        for warp in range(block.warps):
            trips, steps, blends, runs = 0, 0, 0, 0
            for slot in range(block.pixels):
                here = min(max(room.totals[warp, slot, group.WALKED] - begin, 0), block.threads)
                if block.masked:
                    here = room.rounds[warp, slot, k, group.ROUND_VISITS]
                trips, steps = max(trips, here), steps + here
                blends += room.rounds[warp, slot, k, group.ROUND_BLENDS]
                runs += room.rounds[warp, slot, k, group.ROUND_RUNS]
            if steps + BLEND_WEIGHT * blends > worst:
                worst, slowest = steps + BLEND_WEIGHT * blends, (trips, steps, blends, runs)
                bit = np.uint32(1) << np.uint32(warp)
        row[_E.SLOWEST_TRIPS] += slowest[0]
        row[_E.SLOWEST_STEPS] += slowest[1]
        row[_E.SLOWEST_BLEND_STEPS] += slowest[2]
        row[_E.SLOWEST_RUNS] += slowest[3]
        for entry in range(begin, min(begin + block.threads, count)):
            mark = room.marks[entry]
            row[_E.BLEND_TRIPS] += popcount(np.uint64(mark))
            row[_E.COLOUR_FETCHES] += mark > 0
            row[_E.SLOWEST_OWN_BLENDS] += mark > 0 and mark == bit
