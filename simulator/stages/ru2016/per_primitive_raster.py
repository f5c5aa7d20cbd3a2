"""Per-primitive raster: one thread a triangle (Ru 2016's "basic" rasterization).

Each thread walks the pixels of its triangle's box, column by column, each from its lowest row up: barycentric test, an
integer ``atomicMin`` on the depth buffer, and if the value it returns was farther, the fragment is computed and
written, **unprotected**: between the atomic and the write another thread may put a nearer depth and write its fragment
first, and the farther one is then left standing.

The race is modelled, not left to luck. All resident warps walk in lockstep, one box step each a round
(``per_primitive_walk``). The depth operations of a round happen warp after warp, lane after lane. Lanes of one warp at
the same pixel write together, and the lowest one's fragment stays: what an H200 draws wrong in every frame. Fragments
of several warps land before the next round, at one of ``RACE_PLACES`` by a hash of warp and step, as a scheduler would
spread them. A pixel is wrong if the fragment that lands last is not the nearest one. ``RACE_PLACES`` and the rounds
themselves are assumptions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.compiled import words
from tilestamp.simulator.stages.ru2016.per_primitive_walk import DEPTH_SCALE, FAR, walk
from tilestamp.simulator.stages.ru2016.per_primitive_warps import BLOCK, PerPrimitiveEvent, walkers
from tilestamp.simulator.stages.ru2016.tile_lists import SECTOR_BYTES
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES, Visible
from tilestamp.simulator.stages.ru2016.vertex_shading import SHIFTS, Samples
from tilestamp.simulator.work import Work

START_LOADS = 9  # x, y and z of three vertices
HIT_LOADS = 3  # w of three vertices, again at each hit: the stores between may have changed it
WRITE_LOADS = 19  # position and normal of three vertices, the texture pointer
TEXTURE_LOADS = 9  # coordinates of three vertices, pointer, width and height
WRITE_WORDS = 7  # position, normal, whether to shade
TEXTURE_WORDS = 5  # coordinate, pointer (8 bytes at once), width and height


class Race(NamedTuple):
    """What the unprotected writes left.

    Parameters
    ----------
    triangles : ndarray, (H, W), int32
        Triangle of the fragment that landed last.
    landed : ndarray, (H, W), int64
        When: places of all rounds, counted on.
    """

    triangles: NDArray[np.int32]
    landed: NDArray[np.int64]


def per_primitive_raster(
    screen: NDArray[np.float32],
    triangles: NDArray[np.int32],
    drawable: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    culling: bool,
    textured: NDArray[np.bool_] | None = None,
    samples: Samples = "centers",
) -> StageResult[tuple[Visible, Race]]:
    """Draw triangle by triangle.

    Parameters
    ----------
    screen : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
    drawable : ndarray, (F',), int32
    width, height : int
        Pixels.
    simt : Simt
    culling : bool
    textured : ndarray, (F,), bool, or None
        Triangles whose fragments carry texture coordinates; None: none.
    samples : {"centers", "corners"}
        Where in its pixel a sample lies (``vertex_shading``).

    Returns
    -------
    outputs : Visible, Race
        What a protected write would leave: the nearest triangle, and the depth buffer; and what the unprotected write
        leaves in this model.
    works : one, a row a block
    """
    mapped = np.zeros(len(triangles), np.bool_) if textured is None else textured
    visible = np.full((height, width), -1, np.int32)
    depth = np.full((height, width), FAR, np.int32)
    race = Race(np.full((height, width), -1, np.int32), np.full((height, width), -1, np.int64))
    blocks = max(1, -(-len(drawable) // BLOCK))
    events = np.zeros((blocks, len(PerPrimitiveEvent)), np.int64)
    requests = np.zeros(width * height // 8 + 1, np.int64)
    resident = simt.sms * (words(simt).raster_threads // simt.warp)
    walk(
        (screen, triangles, drawable, SHIFTS[samples], mapped),
        culling,
        int(simt.atomic_merge),
        walkers(resident, simt.warp),
        (visible, depth, *race, requests),
        events,
    )
    _add_traffic(events, simt)
    total = events.sum(axis=0)
    written, of_texture = total[[PerPrimitiveEvent.WRITE_LANES, PerPrimitiveEvent.TEXTURED_LANES]].tolist()
    stored = written * WRITE_WORDS + of_texture * TEXTURE_WORDS
    streams = (
        Stream("primitives", "load", 3 * SECTOR_BYTES * len(drawable), 3 * SECTOR_BYTES * len(drawable)),
        Stream("depth", "atomic", 32 * int(total[PerPrimitiveEvent.ATOMIC_REQUESTS]), 4 * width * height),
        Stream(
            "fragments",
            "store",
            SECTOR_BYTES * stored,
            FRAGMENT_BYTES * width * height,
            span_bytes=simt.sms * words(simt).raster_threads * FRAGMENT_BYTES,
        ),
    )
    work = Work(
        "per_primitive_raster", PerPrimitiveEvent, events, BLOCK, grid=blocks, streams=streams, atomic_requests=requests
    )
    return StageResult((Visible(visible, (depth / DEPTH_SCALE).astype(np.float32)), race), (work,))


def _add_traffic(events: NDArray[np.int64], simt: Simt) -> None:
    """Each lane reads its own primitive and writes its own fragment, a segment of its own for each word."""
    segment = smallest_transaction_bytes(int(simt.coalescing))
    written, textured = events[:, PerPrimitiveEvent.WRITE_LANES], events[:, PerPrimitiveEvent.TEXTURED_LANES]
    reads = (
        events[:, PerPrimitiveEvent.WARP_LANES] * START_LOADS
        + events[:, PerPrimitiveEvent.ATOMIC_LANES] * HIT_LOADS
        + written * WRITE_LOADS
        + textured * TEXTURE_LOADS
    )
    writes = written * WRITE_WORDS + textured * TEXTURE_WORDS
    events[:, PerPrimitiveEvent.BLOCKS] = 1
    events[:, PerPrimitiveEvent.LOAD_TRANSACTIONS] = reads
    events[:, PerPrimitiveEvent.LOAD_BYTES] = reads * segment
    events[:, PerPrimitiveEvent.STORE_TRANSACTIONS] = writes
    events[:, PerPrimitiveEvent.STORE_BYTES] = writes * segment
