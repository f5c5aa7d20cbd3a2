"""No cracks: the finer of two neighbours follows the edge of the coarser (not in Eisenacher & Loop 2010).

"Cracks resulting from adaptive subdivision need to be taken care of" (section 5). Where neighbours are split to
different depths, the finer one has vertices between those of the coarser, and off the straight lines that those span.
Here such vertices are put on these lines. Neighbours are found by a table of the sub-patches of the final queue: for
each edge the cells of growing size on its other side are looked up, across edges that patches share as well. Coarse
sub-patches come first, because their own corners may lie on the edge of one that is coarser still.

The machine would dice the sub-patches with such a vertex again, for the ends of the lines, and look neighbours up:
the one is priced as dicing, the other only counted.
"""

from dataclasses import replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice import Grids
from tilestamp.simulator.stages.eisenacher2010.dice_counts import dice_work
from tilestamp.simulator.work import Work

_I64 = NDArray[np.int64]
EDGES = np.array([[0, 1, 2, 3], [12, 13, 14, 15], [0, 4, 8, 12], [3, 7, 11, 15]])  # points by edge: v 0, v 1, u 0, u 1
SEGMENTS = 3  # of a grid's edge
BLOCK = 256  # threads, a sub-patch each


class SnapEvent(IntEnum):
    """Events of one block."""

    LOOKUPS = 0  # in the table of sub-patches, a lane each; without a price
    SNAPPED = 1  # sub-patches with a vertex that was looked at


class Snapped(NamedTuple):
    """Grids without cracks, and what that took."""

    grids: Grids
    touched: NDArray[np.bool_]  # (N,) sub-patches with a vertex that was looked at
    lookups: _I64  # (N,) in the table of sub-patches


def shared_edges(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """Neighbours of patches: (P, 4, 3) of patch, edge, and whether it runs the other way; -1 where there is none.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Edges are shared where all four control points are equal.
    """
    found = np.full((len(points), 4, 3), -1, np.int64)
    seen: dict[bytes, tuple[int, int]] = {}
    for patch in range(len(points)):
        for edge in range(4):
            along = points[patch, EDGES[edge]]
            for backwards, key in enumerate((along.tobytes(), along[::-1].tobytes())):
                if key in seen:
                    other = seen[key]
                    found[patch, edge] = *other, backwards
                    found[other] = patch, edge, backwards
                    break
            seen[along.tobytes()] = patch, edge
    return found


def snap_edges(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    grids: Grids,
    simt: Simt,
    *,
    textured: bool = False,
) -> StageResult[Snapped]:
    """Put the vertices of finer sub-patches on the edges of their coarser neighbours.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Control points of the urPatches.
    subpatches : SubPatches
    grids : Grids
        Diced from them.
    simt : Simt
    textured : bool

    Returns
    -------
    outputs : Snapped
    works : the look-ups, and dicing the sub-patches concerned again; none where all are of one depth
    """
    patch, level, i, j = (array.astype(np.int64) for array in subpatches[:4])
    shared, keys = shared_edges(points), _keys(patch, level, i, j)
    order = np.argsort(keys)
    table = keys[order]
    vertices, touched, lookups = grids.vertices.copy(), np.zeros(len(keys), np.bool_), np.zeros(len(keys), np.int64)
    for depth in np.unique(level)[1:]:
        cells = np.flatnonzero(level == depth)
        for edge in range(4):
            fine, other, other_edge, along = _across(cells, edge, depth, patch, i, j, shared)
            for up in range(1, int(depth) + 1):
                lookups[fine] += 1
                at, known = _find(table, other, other_edge, along, int(depth), up)
                _snap(vertices, fine[known], edge, order[at[known]], other_edge[known], along[known], up)
                touched[fine[known]] = True
                fine, other, other_edge, along = (a[~known] for a in (fine, other, other_edge, along))
    snapped = Snapped(Grids(vertices, _boxes(vertices)), touched, lookups)
    return StageResult(snapped, snap_works(snapped, subpatches.patch, len(points), simt, textured))


def snap_works(
    snapped: Snapped, patch: NDArray[np.int32], patches: int, simt: Simt, textured: bool
) -> tuple[Work, ...]:
    """Work of the look-ups, and of dicing the sub-patches that were touched once more."""
    if not snapped.touched.any():
        return ()
    starts = np.arange(0, len(snapped.touched), BLOCK)
    counts = np.stack([snapped.lookups, snapped.touched], axis=1).astype(np.int64)
    table = np.add.reduceat(counts, starts, axis=0)
    again = dice_work(patch[snapped.touched], patches, textured, simt)
    return (
        Work(stage="snap_edges", kernel="snap_edges", events=SnapEvent, table=table, grid=len(starts), block=BLOCK),
        replace(again, stage="snap_edges"),
    )


def _keys(patch: _I64, level: _I64, i: _I64, j: _I64) -> _I64:
    return patch << 32 | level << 28 | i << 14 | j


def _across(
    cells: _I64, edge: int, depth: int, patch: _I64, i: _I64, j: _I64, shared: _I64
) -> tuple[_I64, _I64, _I64, _I64]:
    """What lies on the other side of an edge, for cells of one depth.

    Returns the cells that have a neighbour; its patch; 4 times the row or column of its cell plus the edge of the cell;
    and the cell's place along the edge, negative (-1 - place) where the edge runs the other way.
    """
    last = (1 << int(depth)) - 1
    row, place = (j[cells], i[cells]) if edge < 2 else (i[cells], j[cells])
    inside = row > 0 if edge % 2 == 0 else row < last
    step = -1 if edge % 2 == 0 else 1
    link = shared[patch[cells], edge]
    kept = inside | (link[:, 0] >= 0)
    line = np.where(inside, row + step, np.where(link[:, 1] % 2 == 0, 0, last))
    facing = np.where(inside, edge ^ 1, link[:, 1])
    along = np.where(~inside & (link[:, 2] == 1), -1 - place, place)
    other = np.where(inside, patch[cells], link[:, 0])
    return cells[kept], other[kept], (4 * line + facing)[kept], along[kept]


def _find(
    table: _I64, other: _I64, other_edge: _I64, along: _I64, depth: int, up: int
) -> tuple[_I64, NDArray[np.bool_]]:
    """Look up the cells ``up`` levels coarser on the other side."""
    place = np.where(along < 0, (1 << depth) + along, along) >> up
    line, by_row = other_edge // 4 >> up, other_edge % 4 < 2
    i, j = np.where(by_row, place, line), np.where(by_row, line, place)
    keys = _keys(other, np.full(len(other), depth - up), i, j)
    at = np.minimum(np.searchsorted(table, keys), len(table) - 1)
    return at, table[at] == keys


def _snap(
    vertices: NDArray[np.float32], fine: _I64, edge: int, coarse: _I64, other_edge: _I64, along: _I64, up: int
) -> None:
    """Move the four vertices of an edge of the fine grids to the polyline of the coarse ones."""
    place = np.where(along < 0, -1 - along, along)
    size = SEGMENTS << up
    for k in range(SEGMENTS + 1):
        at = (SEGMENTS * place + k) % size  # in the coarse cell, in steps of the fine one
        at = np.where((at == 0) & (k == SEGMENTS), size, at)
        at = np.where(along < 0, size - at, at)
        m = np.minimum(at >> up, SEGMENTS - 1)
        share = ((at - (m << up)) / (1 << up)).astype(np.float32)[:, None]
        ends = EDGES[other_edge % 4]
        rows = np.arange(len(fine))
        first, second = vertices[coarse, ends[rows, m], :3], vertices[coarse, ends[rows, m + 1], :3]
        vertices[fine, EDGES[edge][k], :3] = first + share * (second - first)


def _boxes(vertices: NDArray[np.float32]) -> NDArray[np.float32]:
    low, high = vertices[:, :, :2].min(axis=1), vertices[:, :, :2].max(axis=1)
    return np.concatenate([low, high], axis=1)
