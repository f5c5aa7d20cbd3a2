"""What bound and split costs: the events of its kernels, counted from the paths that the oracle took.

The shape of the kernels is ours where the paper is silent: 256 threads a block, a thread a sub-patch; a queue entry of
8 bytes (patch index; level, i and j packed); 16 loads of 16 bytes for the control points; storage wishes of 4 bytes.
"""

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.work import Work

STAGE = "bound_and_split"
BLOCK = 256  # threads
ENTRY_BYTES = 8
POINT_BYTES = 16  # a homogeneous control point
POINTS = 16  # of a patch
WORD_BYTES = 4
_KEEP, _GIVE_UP = 1, 2  # Path of the oracle: from 3 on a patch is split
_ACROSS = 3


class TransformEvent(IntEnum):
    """Events of one block that takes control points to clip space, a thread a point."""

    POINT_WARPS = 0
    POINT_LANES = 1
    LOAD_TRANSACTIONS = 2
    LOAD_BYTES = 3
    STORE_TRANSACTIONS = 4
    STORE_BYTES = 5


class OracleEvent(IntEnum):
    """Events of one block of the oracle, a thread a sub-patch."""

    EXAMINE_WARPS = 0  # warps that fetch 16 control points, restrict them to the square and test them for the screen
    EXAMINE_LANES = 1  # sub-patches
    BOX_WARPS = 2  # warps of those in which a lane goes on to project the points and measure the box
    BOX_LANES = 3
    DIVERGENT_WARPS = 4  # warps in which some lanes measure a box and others do not
    CULLED = 5
    KEPT = 6
    SPLIT = 7
    GIVEN_UP = 8
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12


class SubdivideEvent(IntEnum):
    """Events of one block of the subdivision, a thread a sub-patch."""

    MOVE_WARPS = 0  # warps that load entries, wishes and places
    MOVE_LANES = 1
    KEEP_WARPS = 2  # warps in which a lane moves its entry
    KEEP_LANES = 3
    SPLIT_WARPS = 4  # warps in which a lane writes four children
    SPLIT_LANES = 5
    DIVERGENT_WARPS = 6  # warps that take both ways, or one with lanes idle
    LOAD_TRANSACTIONS = 7
    LOAD_BYTES = 8
    STORE_TRANSACTIONS = 9
    STORE_BYTES = 10


_O = OracleEvent
_S = SubdivideEvent
_T = TransformEvent


@kernel(lent=True)
def _count_oracle_warp(
    first: Any, lanes: int, patch: Any, path: Any, entries: Any, coalescing: Any, addresses: Any, row: Any
) -> None:
    """Events of one warp of the oracle, which loads its ``entries`` of the queue."""
    boxes = kept = split = given_up = 0
    for lane in range(lanes):
        found = path[first + lane]
        boxes += (found == _KEEP) | (found > _ACROSS)
        kept += found == _KEEP
        split += found >= _ACROSS
        given_up += found == _GIVE_UP
    row[_O.KEPT] += kept
    row[_O.SPLIT] += split
    row[_O.GIVEN_UP] += given_up
    row[_O.CULLED] += lanes - kept - split - given_up
    row[_O.EXAMINE_WARPS] += 1
    row[_O.EXAMINE_LANES] += lanes
    row[_O.BOX_WARPS] += boxes > 0
    row[_O.BOX_LANES] += boxes
    row[_O.DIVERGENT_WARPS] += 0 < boxes < lanes
    for lane in range(lanes):
        addresses[lane] = np.int64(patch[first + lane]) * (POINTS * POINT_BYTES)
    count, size = transactions(addresses, lanes, POINT_BYTES, coalescing)
    row[_O.LOAD_TRANSACTIONS] += POINTS * count + entries[0]  # 16 loads differ by less than a patch's segment
    row[_O.LOAD_BYTES] += POINTS * size + entries[1]
    count, size = contiguous(first * WORD_BYTES, lanes * WORD_BYTES, coalescing)
    row[_O.STORE_TRANSACTIONS] += count
    row[_O.STORE_BYTES] += size


@kernel(lent=True)
def _count_subdivide_warp(
    first: Any, lanes: int, path: Any, places: Any, entries: Any, coalescing: Any, addresses: Any, row: Any
) -> None:
    """Events of one warp of the subdivision: one store of what is kept, then four of children."""
    kept = split = 0
    for lane in range(lanes):
        kept += path[first + lane] == _KEEP
        split += path[first + lane] >= _ACROSS
    row[_S.MOVE_WARPS] += 1
    row[_S.MOVE_LANES] += lanes
    row[_S.KEEP_WARPS] += kept > 0
    row[_S.KEEP_LANES] += kept
    row[_S.SPLIT_WARPS] += split > 0
    row[_S.SPLIT_LANES] += split
    row[_S.DIVERGENT_WARPS] += 0 < kept < lanes or 0 < split < lanes
    words, word_bytes = contiguous(first * WORD_BYTES, lanes * WORD_BYTES, coalescing)
    row[_S.LOAD_TRANSACTIONS] += entries[0] + 2 * words
    row[_S.LOAD_BYTES] += entries[1] + 2 * word_bytes
    for store in range(5):
        if (kept if store == 0 else split) == 0:
            continue
        for lane in range(lanes):
            found = path[first + lane]
            active = found == _KEEP if store == 0 else found >= _ACROSS
            child = max(store - 1, 0)
            addresses[lane] = (np.int64(places[first + lane]) + child) * ENTRY_BYTES if active else -1
        count, size = transactions(addresses, lanes, ENTRY_BYTES, coalescing)
        row[_S.STORE_TRANSACTIONS] += count
        row[_S.STORE_BYTES] += size


@kernel(lent=True)
def _entries(lanes: int, coalescing: Any, addresses: Any) -> tuple[int, int]:
    """Transactions and bytes of a warp's load of its queue entries: warps are aligned alike."""
    for lane in range(lanes):
        addresses[lane] = lane * ENTRY_BYTES
    count, size = transactions(addresses, lanes, ENTRY_BYTES, coalescing)
    return count, size


@kernel(lent=True)
def _count_part(
    part: int, parts: int, patch: Any, path: Any, places: Any, warp: int, coalescing: Any, table: Any, addresses: Any
) -> None:
    """``_count_blocks``, with scratch for one warp."""
    entries = _entries(warp, coalescing, addresses)
    for block in range(part * table.shape[0] // parts, (part + 1) * table.shape[0] // parts):
        end = min((block + 1) * BLOCK, path.shape[0])
        for first in range(block * BLOCK, end, warp):
            lanes = min(warp, end - first)
            if lanes < warp:
                entries = _entries(lanes, coalescing, addresses)
            if places is None:
                _count_oracle_warp(first, lanes, patch, path, entries, coalescing, addresses, table[block])
            else:
                _count_subdivide_warp(first, lanes, path, places, entries, coalescing, addresses, table[block])


@kernel
def _count_blocks(
    part: int, parts: int, patch: Any, path: Any, places: Any, warp: int, coalescing: Any, table: Any
) -> None:
    """Events of the blocks of one part; of the subdivision where ``places`` are given."""
    _count_part(part, parts, patch, path, places, warp, coalescing, table, np.empty(warp, np.int64))


def _blocks(threads: int) -> int:
    return -(-threads // BLOCK)


def _work(kernel: str, events: type[IntEnum], table: NDArray[np.int64], *streams: Stream) -> Work:
    return Work(stage=STAGE, kernel=kernel, events=events, table=table, grid=len(table), block=BLOCK, streams=streams)


def transform_work(patches: int, simt: Simt) -> Work:
    """Work of taking the control points of all urPatches to clip space, once a frame."""
    points = patches * POINTS
    threads = np.minimum(BLOCK, points - BLOCK * np.arange(_blocks(points)))
    table = np.zeros((len(threads), len(_T)), np.int64)
    table[:, _T.POINT_WARPS] = -(-threads // simt.warp)
    table[:, _T.POINT_LANES] = threads
    addresses = np.arange(simt.warp, dtype=np.int64) * POINT_BYTES
    count, size = transactions(addresses, simt.warp, POINT_BYTES, int(simt.coalescing))
    half = transactions(addresses, simt.warp // 2, POINT_BYTES, int(simt.coalescing))
    odd = threads % simt.warp > 0  # points come by 16: the last warp may be half full
    moved = np.outer(threads // simt.warp, (count, size)) + np.outer(odd, half)
    table[:, [_T.LOAD_TRANSACTIONS, _T.LOAD_BYTES]] = moved
    table[:, [_T.STORE_TRANSACTIONS, _T.STORE_BYTES]] = moved
    total, nbytes = int(table[:, _T.LOAD_BYTES].sum()), points * POINT_BYTES
    load, store = (
        Stream("points", "load", total, nbytes),
        Stream("clip_points", "store", total, nbytes, partial_lines=0),
    )
    return _work("transform", _T, table, load, store)


def oracle_work(patch: NDArray[np.int32], path: NDArray[np.uint8], simt: Simt) -> Work:
    """Work of one pass of the oracle.

    Parameters
    ----------
    patch, path : ndarray, (queue length,)
        urPatch, and the oracle's ``Path``, of each sub-patch.
    simt : Simt
    """
    table = np.zeros((_blocks(len(path)), len(_O)), np.int64)
    for_parts(_count_blocks, parts_of(len(table)), patch, path, None, simt.warp, int(simt.coalescing), table)
    return _work("oracle", _O, table, *oracle_streams(table, patch))


def oracle_streams(table: NDArray[np.int64], patch: NDArray[np.int32]) -> tuple[Stream, ...]:
    """Buffers of one pass of the oracle, from the rows of all its blocks."""
    total = table.sum(axis=0)
    entries = len(patch) * ENTRY_BYTES
    distinct = 1 + int(np.count_nonzero(np.diff(patch))) if len(patch) else 0
    return (
        Stream("queue", "load", entries, entries),
        Stream("clip_points", "load", int(total[_O.LOAD_BYTES]) - entries, distinct * POINTS * POINT_BYTES),
        Stream("slots", "store", int(total[_O.STORE_BYTES]), len(patch) * WORD_BYTES, partial_lines=0),
    )


def scan_works(scan: Sequence[Work]) -> list[Work]:
    """Works of the scan, which is that of bucketing, under the names of this stage."""
    names: dict[str, Any] = {"COUNT": "slots", "START": "places"}
    return [
        replace(
            work,
            stage=STAGE,
            streams=tuple(replace(stream, buffer=names.get(stream.buffer, stream.buffer)) for stream in work.streams),
        )
        for work in scan
    ]


def subdivide_work(path: NDArray[np.uint8], places: NDArray[np.uint32], simt: Simt) -> Work:
    """Work of one pass of the subdivision.

    Parameters
    ----------
    path, places : ndarray, (queue length,)
        The oracle's ``Path``, and the first slot in the other queue, of each sub-patch.
    simt : Simt
    """
    table = np.zeros((_blocks(len(path)), len(_S)), np.int64)
    for_parts(_count_blocks, parts_of(len(table)), path, path, places, simt.warp, int(simt.coalescing), table)
    return _work("subdivide", _S, table, *subdivide_streams(table, len(path)))


def subdivide_streams(table: NDArray[np.int64], length: int) -> tuple[Stream, ...]:
    """Buffers of one pass of the subdivision of a queue, from the rows of all its blocks."""
    total = table.sum(axis=0)
    loads = length * (ENTRY_BYTES + 2 * WORD_BYTES)
    written = int(total[_S.KEEP_LANES] + 4 * total[_S.SPLIT_LANES]) * ENTRY_BYTES
    return (
        Stream("queue", "load", length * ENTRY_BYTES, length * ENTRY_BYTES),
        Stream("slots", "load", length * WORD_BYTES, length * WORD_BYTES),
        Stream("places", "load", int(total[_S.LOAD_BYTES]) - loads + length * WORD_BYTES, length * WORD_BYTES),
        Stream("queue", "store", int(total[_S.STORE_BYTES]), written),
    )
