"""Dice with vertices shared between neighbours: one grid shades a vertex, and stores it for the others.

Not in Eisenacher & Loop 2010, whose grids each shade their own edges: 16 vertices for 9 quads. A grid leaves its left
column to the grid on the left and its top row to the one above, where there are such (``link_grids``). A block counts
the vertices that are left to its grids and deals them to its threads, so that warps stay full. All grids are stored
whole, as the tile raster reads them: who shades a vertex stores it in each grid that has it. So no block has all
vertices of a grid, and a further kernel finds the boxes.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.coalescing import SECTOR_BYTES, transactions
from tilestamp.models.counters import count, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import (
    BLOCK,
    BOX_BYTES,
    ENTRY_BYTES,
    POINT_BYTES,
    VERTEX_BYTES,
    VERTICES,
    dice_work,
)
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide
from tilestamp.simulator.stages.eisenacher2010.link_grids import LINKS_BYTES, Links
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.work import Work

COPIES = 3  # to the grid on the right, below, below on the right


@shown(count("VERTEX_LANES", "vertices shaded"), count("COPY_LANES", "of them stored for a neighbour"))
class SharedVertexEvent(IntEnum):
    """Events of one block: as many whole grids as it has threads for."""

    PATCHES = 0  # sub-patches
    VERTEX_WARPS = 1  # warps that evaluate, shade and store a vertex a lane
    VERTEX_LANES = 2
    COPY_WARPS = 3  # warps that store a vertex in a neighbour's grid as well
    COPY_LANES = 4
    TEXTURE_LANES = 5
    LOAD_TRANSACTIONS = 6
    LOAD_BYTES = 7
    STORE_TRANSACTIONS = 8
    STORE_BYTES = 9


_E = SharedVertexEvent


def own_vertices(links: Links, side: int) -> NDArray[np.bool_]:
    """Which vertices each grid shades, (N, side**2)."""
    own = np.ones((len(links.before), side, side), np.bool_)
    left, above, corner = (links.before >= 0).T
    own[left, :, 0] = False
    own[above, 0, :] = False
    own[corner, 0, 0] = False
    return own.reshape(-1, side**2)


def dice_shared(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    links: Links,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    *,
    texture: NDArray[np.uint8] | None = None,
    shaded: bool = True,
    side: GridSide = 4,
) -> StageResult[Grids]:
    """Shade each vertex by one grid, and store it in all that have it.

    Parameters
    ----------
    points, subpatches, matrix, width, height, simt, texture, shaded, side
        As for ``dice``.
    links : Links
        Neighbours of the sub-patches.

    Returns
    -------
    outputs : Grids
        Bit for bit those that were diced each by itself.
    works : dicing, and finding the boxes; a row a block
    facts : shaded_vertices
    """
    size: dict[str, Any] = {"matrix": matrix, "width": width, "height": height, "simt": simt}
    grids = dice(points, subpatches, **size, texture=texture, counting=False, shaded=shaded, side=side).outputs
    own = own_vertices(links, side)
    vertices = np.where(own[..., None], grids.vertices, np.float32(np.nan))
    whole, made = vertices.reshape(-1, side, side, 4), own.reshape(-1, side, side)
    right, below, corner = links.after.T
    for to, source, target in (
        (right, (slice(None), -1), (slice(None), 0)),
        (below, (-1, slice(None)), (0, slice(None))),
        (corner, (-1, -1), (0, 0)),
    ):
        known = np.flatnonzero(to >= 0)
        old = whole[to[known], *target]
        whole[to[known], *target] = np.where(made[known, *source][..., None], whole[known, *source], old)
    number = vertices.shape[0] * vertices.shape[1]
    ends = (Access("grids", VERTEX_BYTES, 1, VERTEX_BYTES),), (Access("boxes", BOX_BYTES // VERTICES, 1, 1),)
    boxes = thread_per_item("dice", "box_grids", number, BLOCK, simt, *ends)
    dicing = _work(own, links, subpatches.patch, len(points), texture is not None, simt, side)
    return StageResult(Grids(vertices, grids.boxes), (dicing, boxes), {"shaded_vertices": int(own.sum())})


@kernel
def _count_stores(own: Any, after: Any, side: int, per_block: int, warp: int, coalescing: int, table: Any) -> None:
    """Vertices of each block, and its stores at their real addresses."""
    vertices = side * side
    grid, place, addresses = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int64), np.empty(warp, np.int64)
    for block in range(table.shape[0]):
        row, shaded = table[block], 0
        for n in range(block * per_block, min((block + 1) * per_block, own.shape[0])):
            row[_E.PATCHES] += 1
            for k in range(vertices):
                if own[n, k]:
                    grid[shaded], place[shaded] = n, k
                    shaded += 1
        row[_E.VERTEX_LANES] = shaded
        row[_E.VERTEX_WARPS] = (shaded + warp - 1) // warp
        for first in range(0, shaded, warp):
            lanes = min(warp, shaded - first)
            for copy in range(COPIES + 1):
                active = 0
                for lane in range(lanes):
                    n, k = grid[first + lane], place[first + lane]
                    last_column, last_row = k % side == side - 1, k // side == side - 1
                    kept = (last_column or not copy & 1) and (last_row or not copy & 2)
                    to = n if copy == 0 else after[n, copy - 1]
                    at = k - (side - 1 if copy & 1 else 0) - (vertices - side if copy & 2 else 0)
                    addresses[lane] = (to * vertices + at) * VERTEX_BYTES if kept and to >= 0 else -1
                    active += addresses[lane] >= 0
                if copy > 0 and active > 0:
                    row[_E.COPY_WARPS] += 1
                    row[_E.COPY_LANES] += active
                stores, store_bytes = transactions(addresses, lanes, VERTEX_BYTES, coalescing)
                row[_E.STORE_TRANSACTIONS] += stores
                row[_E.STORE_BYTES] += store_bytes


def _work(
    own: NDArray[np.bool_], links: Links, patch: NDArray[np.int32], patches: int, textured: bool, simt: Simt, side: int
) -> Work:
    """Work of the kernel: it loads what dicing loads, and the links."""
    plain = dice_work(patch, patches, textured, simt, side)
    table = np.zeros((plain.grid, len(_E)), np.int64)
    _count_stores(own, links.after, side, BLOCK // side**2, simt.warp, int(simt.coalescing), table)
    number, stored = len(patch), int(table[:, _E.STORE_BYTES].sum())
    for name in ("LOAD_TRANSACTIONS", "LOAD_BYTES"):
        table[:, SharedVertexEvent[name]] = plain.table[:, plain.events[name]]
    loaded: int = int(table[:, _E.LOAD_BYTES].sum())
    linked = -(-table[:, _E.PATCHES] * 2 * LINKS_BYTES // SECTOR_BYTES)  # both vectors of each grid, one after another
    table[:, _E.LOAD_TRANSACTIONS] += linked
    table[:, _E.LOAD_BYTES] += SECTOR_BYTES * linked
    table[:, _E.TEXTURE_LANES] = table[:, _E.VERTEX_LANES] * textured
    streams = (
        Stream("queue", "load", number * ENTRY_BYTES, number * ENTRY_BYTES),
        Stream("points", "load", loaded - number * ENTRY_BYTES, patches * VERTICES * POINT_BYTES),
        Stream("links before", "load", number * LINKS_BYTES, number * LINKS_BYTES),
        Stream("links after", "load", number * LINKS_BYTES, number * LINKS_BYTES),
        Stream("grids", "store", stored, number * side**2 * VERTEX_BYTES),
    )
    return Work("dice", _E, table, BLOCK, kernel="dice_shared", shared_bytes=plain.shared_bytes, streams=streams)
