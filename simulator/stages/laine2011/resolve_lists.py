"""Resolve lists of fragments: a thread a pixel sorts its list by depth, and blends it back to front.

A thread walks its list and inserts each fragment where it belongs among those before, in local memory; of equal depths
the later one in input order lies in front. Lanes wait for the longest list of their warp, and in each insertion for the
lane that moves most fragments. Blending is in float32, and rounded to bytes once.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes, transactions
from tilestamp.models.counters import count, distribution, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.fine_raster_queue import PIXELS, TILE, WARP
from tilestamp.simulator.stages.laine2011.fragment_lists import FRAGMENT_BYTES, LINK_BYTES, FragmentLists
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
_PIXEL_BYTES = 4


@shown(
    count("LIST_LANES", "fragments in lists"),
    ratio(
        "list_fill",
        "LIST_LANES",
        "LIST_ROOM",
        "lanes with a fragment left while the longest list of the warp is walked",
    ),
    ratio("sort_fill", "SORT_LANES", "SORT_ROOM", "lanes that move a fragment while one of the warp does"),
    distribution("list_length", "LONGEST", "longest list of a block"),
)
class ResolveEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    LIST_STEPS = 1  # fragments of the longest list of a warp
    LIST_LANES = 2
    SORT_STEPS = 3  # moves of the lane that moves most, insertion by insertion
    SORT_LANES = 4
    LIST_ROOM = 5  # lanes of the steps, idle ones too
    SORT_ROOM = 6
    CHAIN_LISTS = 7  # steps of the block's longest warp ...
    CHAIN_SORTS = 8  # ... and its moves
    LONGEST = 9
    LOAD_TRANSACTIONS = 10
    LOAD_BYTES = 11
    STORE_TRANSACTIONS = 12
    STORE_BYTES = 13


@kernel(lent=True)
def _insert(keys: Any, colors: Any, n: int, depth: int, color: int, newest_first: bool) -> int:
    """Insert a fragment among n sorted back to front; returns how many it moves."""
    at = n
    while at > 0 and (keys[at - 1] < depth or (newest_first and keys[at - 1] == depth)):
        keys[at], colors[at] = keys[at - 1], colors[at - 1]
        at -= 1
    keys[at], colors[at] = depth, color
    return n - at


@kernel(lent=True)
def _composed(colors: Any, n: int, behind: int) -> Any:
    """Blend n colours, back to front, over one; rounded to bytes at the end."""
    result = np.int64(0)
    for shift in range(0, 32, 8):
        value = np.float32((behind >> shift) & 255)
        for i in range(n):
            alpha = np.float32(colors[i] >> 24) * np.float32(1 / 255)
            value += alpha * (np.float32((colors[i] >> shift) & 255) - value)
        result |= np.int64(value + np.float32(0.5)) << shift
    return result


@kernel(lent=True)
def _warp(first: int, lists: Any, fixed: bool, scratch: Any, rule: int, row: Any) -> tuple[int, int]:
    """Walk and sort the lists of 32 pixels in lockstep; returns steps and moves."""
    heads, lengths, color, depth, links = lists
    keys, colors, node, addresses, room = scratch
    longest = moves = lanes = moved = 0
    for lane in range(WARP):
        at = first + lane
        node[lane] = heads[at] if not fixed else (at // PIXELS * room) * PIXELS + at % PIXELS
        longest = max(longest, lengths[at])
    for step in range(longest):
        most = 0
        for lane in range(WARP):
            addresses[lane] = -1
            if step < lengths[first + lane]:
                here = node[lane]
                addresses[lane] = here * FRAGMENT_BYTES
                shifted = _insert(
                    keys[lane], colors[lane], step, np.int64(depth[here]), np.int64(color[here]), not fixed
                )
                most, moved, lanes = max(most, shifted), moved + shifted, lanes + 1
                node[lane] = here + PIXELS if fixed else links[here]
        moves += most
        _count_load(addresses, FRAGMENT_BYTES, rule, row)
        if not fixed:
            for lane in range(WARP):
                addresses[lane] = addresses[lane] // FRAGMENT_BYTES * LINK_BYTES if addresses[lane] >= 0 else -1
            _count_load(addresses, LINK_BYTES, rule, row)
    row[ResolveEvent.WARPS] += 1
    row[ResolveEvent.LIST_STEPS] += longest
    row[ResolveEvent.LIST_LANES] += lanes
    row[ResolveEvent.SORT_STEPS] += moves
    row[ResolveEvent.SORT_LANES] += moved
    row[ResolveEvent.LONGEST] = max(row[ResolveEvent.LONGEST], longest)
    return longest, moves


@kernel(lent=True)
def _count_load(addresses: Any, size: int, rule: int, row: Any) -> None:
    loads, read = transactions(addresses, WARP, size, rule)
    row[ResolveEvent.LOAD_TRANSACTIONS] += loads
    row[ResolveEvent.LOAD_BYTES] += read


@kernel
def _resolve_part(
    part: int, parts: int, lists: Any, fixed: bool, room: int, longest: int, behind: int, tiles_x: int, rule: int,
    image: Any, table: Any,
) -> None:  # fmt: skip
    """Resolve a share of the blocks."""
    keys, colors = np.empty((WARP, longest), np.int64), np.empty((WARP, longest), np.int64)
    scratch = keys, colors, np.empty(WARP, np.int64), np.empty(WARP, np.int64), room
    lent, scraps, pixels = borrow(lists), borrow(scratch), borrow(image)
    for block in range(table.shape[0] * part // parts, table.shape[0] * (part + 1) // parts):
        row = table[block]
        for first in range(block * BLOCK, min((block + 1) * BLOCK, lists[0].size), WARP):
            steps, moves = _warp(first, lent, fixed, scraps, rule, borrow(row))
            if steps > row[ResolveEvent.CHAIN_LISTS]:
                row[ResolveEvent.CHAIN_LISTS], row[ResolveEvent.CHAIN_SORTS] = steps, moves
            for lane in range(WARP):
                p, tile = (first + lane) % PIXELS, (first + lane) // PIXELS
                x, y = tile % tiles_x * TILE + 7 - (p & 7), tile // tiles_x * TILE + (p >> 3)
                pixels[y, x] = _composed(colors[lane], lists[1][first + lane], behind)


def resolve_lists(
    lists: FragmentLists, image: NDArray[np.uint32], simt: Simt, *, clear_color: int = 0
) -> StageResult[NDArray[np.uint32]]:
    """Sort and blend the fragments of each pixel.

    Parameters
    ----------
    lists : FragmentLists
    image : ndarray, (H, W), uint32
        Whole tiles, row 0 the lowest; written.
    simt : Simt
    clear_color : int
        What lies behind.

    Returns
    -------
    outputs : image
    works : one, a row a block of 256 pixels: four tiles
    """
    fixed, pixels = lists.layout == "fixed", lists.heads.size
    table = np.zeros((-(-pixels // BLOCK), len(ResolveEvent)), np.int64)
    arrays = lists.heads, lists.lengths, lists.color, lists.depth, lists.next
    for_parts(
        _resolve_part, parts_of(len(table), 8),
        arrays, fixed, lists.room, max(1, int(lists.lengths.max(initial=1))), clear_color, image.shape[1] // TILE,
        int(simt.coalescing), image, table,
    )  # fmt: skip
    return StageResult(image, (_resolve_work(table, lists, simt),))


def _resolve_work(table: NDArray[np.int64], lists: FragmentLists, simt: Simt) -> Work:
    """Add heads and pixels, rows of four bytes a lane, to the rows of the lists."""
    E, kept = ResolveEvent, int(lists.lengths.sum())
    table[:, E.LIST_ROOM], table[:, E.SORT_ROOM] = WARP * table[:, E.LIST_STEPS], WARP * table[:, E.SORT_STEPS]
    size = max(smallest_transaction_bytes(int(simt.coalescing)), 32)
    rows = table[:, E.WARPS] * WARP * _PIXEL_BYTES
    read = int(table[:, E.LOAD_BYTES].sum())
    table[:, E.LOAD_TRANSACTIONS] += rows // size
    table[:, E.LOAD_BYTES] += rows
    table[:, E.STORE_TRANSACTIONS] += rows // size
    table[:, E.STORE_BYTES] += rows
    each = FRAGMENT_BYTES + (LINK_BYTES if lists.next.size else 0)
    pixels = _PIXEL_BYTES * lists.heads.size
    streams = (
        Stream("list_heads", "load", pixels, pixels),
        Stream("fragment_lists", "load", read, max(each * kept, 1)),
        Stream("pixels", "store", pixels, pixels, partial_lines=0),
    )
    return Work("resolve", E, table, BLOCK, kernel="resolveLists", streams=streams, variant=lists.layout)
