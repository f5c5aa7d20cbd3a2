"""Lists of fragments in CudaRaster's ROP: an A-buffer for transparency that needs no order of input.

Fine raster keeps every fragment, and a second kernel sorts and blends those of each pixel (``resolve_lists``). A tile
belongs to one warp, so the head of a pixel's list lies in shared memory, where blending keeps its colour, and costs no
global atomic; fragments of one pixel in a round take turns, as they do for blending. What is left is room for nodes:

linked    a node of 12 bytes (colour, depth, next) a fragment, each lane with its own atomic on the one counter of nodes
round     the same with one atomic a round, for all of its lanes
chunked   a warp takes ``room`` nodes at a time for its tile, so that there is an atomic a chunk; what is left of a
          tile's last chunk is lost
fixed     ``room`` places of 8 bytes for each pixel of the screen: no atomic, no links; a fragment too many is dropped
"""

from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.counters import count, counters_of, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.laine2011.fine_raster_queue import PIXELS, WARP, FineRasterEvent
from tilestamp.simulator.stages.laine2011.fine_raster_work import DRAW_REQUESTS, fine_work
from tilestamp.simulator.stages.laine2011.fragments import Fragments, events_with, front
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

Layout = Literal["linked", "round", "chunked", "fixed"]
LAYOUTS: tuple[Layout, ...] = ("linked", "round", "chunked", "fixed")
FRAGMENT_BYTES, LINK_BYTES = 8, 4
Z_BUFFER_BYTES = 8  # colour and depth of a pixel, what a frame without lists has
ListEvent = events_with("ListEvent", __name__, ("ALLOCATIONS", "KEPT", "LOST", "ATOMIC_CONFLICTS"))
"""Rounds in which a warp waits for nodes; fragments that are kept, and those that find no room."""
shown(*counters_of(FineRasterEvent), count("KEPT", "fragments kept in lists"), count("LOST", "fragments without room"))(
    ListEvent
)


class FragmentLists(NamedTuple):
    """Lists of all pixels; pixel p of tile t has place 64 * t + p."""

    layout: Layout
    room: int
    heads: NDArray[np.int64]  # newest node, -1: none; fixed: how many
    lengths: NDArray[np.int64]
    color: NDArray[np.uint32]  # of each node
    depth: NDArray[np.uint32]
    next: NDArray[np.int64]
    bytes: int


@kernel(lent=True)
def _keep_tile(first: int, last: int, place: int, base: int, fragments: Fragments, fixed: bool, lists: Any) -> int:
    """Put the fragments first..last-1 of a tile in lists; returns how many found no room."""
    heads, lengths, color, depth, links, room = lists
    lost = 0
    for i in range(first, last):
        pixel = place + fragments.pixel[i]
        node = base + i - first
        if fixed:
            if lengths[pixel] >= room:
                lost += 1
                continue
            node = base + lengths[pixel] * PIXELS + fragments.pixel[i]
        color[node], depth[node] = fragments.color[i], fragments.depth[i]
        if not fixed:
            links[node] = heads[pixel]
        heads[pixel] = lengths[pixel] + 1 if fixed else node
        lengths[pixel] += 1
    return lost


@kernel(lent=True)
def _count_stores(
    first: int, last: int, base: int, fragments: Fragments, fixed: bool, scratch: Any, rule: int, row: Any
) -> None:
    """Count the stores of a tile's rounds: nodes side by side, or the places of the pixels in their layers."""
    addresses, lengths, room = scratch
    lengths[:] = 0
    for start in range(first, last, WARP):
        n = min(WARP, last - start)
        for lane in range(n):
            p = fragments.pixel[start + lane]
            node = base + lengths[p] * PIXELS + p if fixed else base + start - first + lane
            kept = not fixed or lengths[p] < room
            addresses[lane] = node * FRAGMENT_BYTES if kept else -1
            lengths[p] += 1
        stores, size = transactions(addresses, n, FRAGMENT_BYTES, rule)
        row[FineRasterEvent.STORE_TRANSACTIONS] += stores
        row[FineRasterEvent.STORE_BYTES] += size
        if not fixed:
            for lane in range(n):
                addresses[lane] = addresses[lane] // FRAGMENT_BYTES * LINK_BYTES
            stores, size = transactions(addresses, n, LINK_BYTES, rule)
            row[FineRasterEvent.STORE_TRANSACTIONS] += stores
            row[FineRasterEvent.STORE_BYTES] += size


@kernel
def _keep(
    active: Any, fragments: Fragments, base: Any, fixed: bool, lists: Any, rule: int, table: Any, lost: Any
) -> None:
    """Put all fragments in lists, tile by tile, and count what that stores."""
    scratch = np.empty(WARP, np.int64), np.empty(PIXELS, np.int64), lists[5]
    for a in range(active.size):
        first, last = fragments.first[a], fragments.first[a + 1]
        lost[a] = _keep_tile(first, last, PIXELS * active[a], base[a], fragments, fixed, lists)
        _count_stores(first, last, base[a], fragments, fixed, scratch, rule, table[a])


def keep_fragments(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    layout: Layout,
    room: int,
    colors: NDArray[np.float32],
) -> StageResult[tuple[FrameBuffers, FragmentLists]]:
    """Run fine raster with lists in its ROP.

    Parameters
    ----------
    setup, tile_starts, tile_entries, active_tiles, width, height, simt, colors
        As fine raster takes them; release 1.1, one sample a pixel, no depth test.
    layout : {"linked", "round", "chunked", "fixed"}
    room : int
        Nodes of a chunk, or places of a pixel.

    Returns
    -------
    outputs : FrameBuffers, FragmentLists
        Pixels as blending in input order would leave them, and the lists.
    works : one, a row an active tile
    facts : dict
        ``fragments_kept``, ``fragments_lost``, ``longest_list``, ``list_bytes``, and ``list_share``, those bytes over
        the ones of a colour and a depth for each pixel.
    """
    lists = tile_starts, tile_entries, active_tiles
    made = front(setup, lists, width, height, simt, colors, depth=True)
    counts, tiles, fixed = np.diff(made.fragments.first), len(tile_starts) - 1, layout == "fixed"
    nodes = -(-counts // room) * room if layout == "chunked" else counts
    base = active_tiles.astype(np.int64) * PIXELS * room if fixed else np.cumsum(nodes) - nodes
    total = tiles * PIXELS * room if fixed else int(nodes.sum())
    heads = np.full(tiles * PIXELS, 0 if fixed else -1, np.int64)
    lengths, links = np.zeros_like(heads), np.empty(0 if fixed else total, np.int64)
    stored = np.empty(total, np.uint32), np.empty(total, np.uint32)
    lost = np.zeros(len(active_tiles), np.int64)
    _keep(
        active_tiles, made.fragments, base, fixed, (heads, lengths, *stored, links, room), int(simt.coalescing),
        made.rows, lost,
    )  # fmt: skip
    taken = _allocations(layout, counts, room)
    size = total * (FRAGMENT_BYTES + (0 if fixed else LINK_BYTES)) + 4 * heads.size
    kept = FragmentLists(layout, room, heads, lengths, *stored, links, size)
    lanes = counts if layout == "linked" else taken
    _add_atomics(made.rows, taken, lanes)
    rows = np.column_stack([made.rows, taken, counts - lost, lost, lanes - taken])
    work = fine_work(
        rows, setup, tile_entries, width, height, simt, release="1.1", samples=1, mode=f"lists {layout}"
    )  # fmt: skip
    requests = int(made.rows[:, FineRasterEvent.ATOMIC_REQUESTS].sum()) - len(rows)
    queues = np.array([int(DRAW_REQUESTS["1.1"] * (len(rows) + work.grid * work.block // WARP)), requests])
    stores = Stream("fragment_lists", "store", FRAGMENT_BYTES * int((counts - lost).sum()), size)
    work = replace(work, events=ListEvent, atomic_requests=queues, streams=(*work.streams, stores))
    facts = {
        "fragments_kept": int((counts - lost).sum()),
        "fragments_lost": int(lost.sum()),
        "longest_list": int(lengths.max(initial=0)),
        "list_bytes": size,
        "list_share": size / (Z_BUFFER_BYTES * heads.size),
    }
    return StageResult((made.buffers, kept), (work,), facts)


def _allocations(layout: Layout, counts: NDArray[np.int64], room: int) -> NDArray[np.int64]:
    """Atomic instructions on the counter of nodes, by tile."""
    if layout == "fixed":
        return np.zeros_like(counts)
    taken: NDArray[np.int64] = -(-counts // (room if layout == "chunked" else WARP))
    return taken


def _add_atomics(rows: NDArray[np.int64], instructions: NDArray[np.int64], lanes: NDArray[np.int64]) -> None:
    """All lanes of an instruction want the one counter: they conflict, and none shares a request."""
    rows[:, FineRasterEvent.ATOMIC] += instructions
    for event in (FineRasterEvent.ATOMIC_LANES, FineRasterEvent.ATOMIC_REQUESTS, FineRasterEvent.ATOMIC_DEPTH):
        rows[:, event] += lanes
