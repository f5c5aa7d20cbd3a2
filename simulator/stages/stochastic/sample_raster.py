"""Raster of moving triangles: one block a tile, one thread a pixel, one test for each sample that the mask leaves.

Samples of the tile, and their nearest depth and triangle, stay in shared memory. A warp tests the samples of one number
together: all lie in one interval of time and lens, so that the mask of an entry leaves out whole warp executions. A
line of sight (``ray_raster``) is tested alike. CUDA form: ``experiments/cuda/stochastic.cu``.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.counters import shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, keep_nearest
from tilestamp.simulator.stages.fatahalian2009.motion import BlurPattern
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.stages.stochastic.tile_lists import ENTRY_BYTES, TRIANGLE_BYTES, MovingLists
from tilestamp.simulator.stages.stochastic.triangles import MovingTriangles, covers, depth_along, depth_of, seen_from
from tilestamp.simulator.work import Work

SAMPLE_BYTES = 20 + 8  # time and the sample's own x and y twice; depth and triangle
PATTERN_BYTES = 16  # time, lens and place of a sample, as it is read
VECTOR_BYTES = 16  # of a load of the triangle, the same for all lanes: a segment each
PLANES_BYTES = 48  # three normals and the volume, padded
PIXEL_BYTES = 4
FAILS = np.float32(-1.0)


@shown(*SAMPLE_COUNTERS)
class SampleRasterEvent(IntEnum):
    """Events of one block, that is of one tile."""

    WARPS = 0
    WARP_LANES = 1
    SAMPLES = 2  # warp executions that set a sample of each pixel up, and resolve it at the end
    ENTRY_WARPS = 3  # warp executions that fetch an entry and its triangle
    TEST_WARPS = 4  # warp executions of the sample test
    SAMPLE_TESTS = 5  # lanes of them, off-screen ones included
    SAMPLE_HITS = 6
    HIT_WARPS = 7  # warp executions of the depth test
    ENTRIES = 8  # the dependent chain of the block
    MASKED_TESTS = 9  # samples of an entry that its mask leaves: steps of that chain
    LOAD_TRANSACTIONS = 10
    LOAD_BYTES = 11
    STORE_TRANSACTIONS = 12
    STORE_BYTES = 13


def sample_raster(
    triangles: MovingTriangles, lists: MovingLists, pattern: BlurPattern, samples: Samples, simt: Simt, *, tile: int
) -> StageResult[Samples]:
    """Find the nearest triangle of each sample.

    Parameters
    ----------
    triangles : MovingTriangles
        Tests are made in the precision of its corners.
    lists : MovingLists
    pattern : BlurPattern
    samples : Samples
        Written.
    simt : Simt
    tile : int
        Pixels on a side.

    Returns
    -------
    outputs : Samples
    works : one, a row a tile
    """
    kind = triangles.corners.dtype
    place = (pattern.place / SUBPIXELS).astype(kind)
    aperture, focus = (kind.type(value) for value in triangles.lens)
    events = np.zeros((len(lists.starts) - 1, len(SampleRasterEvent)), np.int64)
    for_parts(
        _sample_raster, parts_of(-(-samples.height // tile)), triangles.corners, aperture, focus, *lists, place,
        pattern.time_lens.astype(kind), np.arange(max(samples.width, samples.height)).astype(kind), None, None,
        samples, tile, simt.warp, events,
    )  # fmt: skip
    _add_traffic(events, simt, len(samples.offsets), TRIANGLE_BYTES)
    table = PATTERN_BYTES * pattern.place.shape[0] ** 2 * len(samples.offsets)
    variant = "double" if kind == np.float64 else ""
    return StageResult(samples, (_work(events, lists, samples, tile, variant, TRIANGLE_BYTES, table),))


def ray_raster(
    normals: NDArray[Any], volumes: NDArray[Any], lists: MovingLists, rays: NDArray[np.float64], samples: Samples,
    simt: Simt, *, tile: int,
) -> StageResult[Samples]:  # fmt: skip
    """Find the nearest triangle along each line of sight.

    Parameters
    ----------
    normals, volumes
        As in ``EdgePlanes``; tests are made in their precision.
    lists, samples, simt, tile
        As for ``sample_raster``.
    rays : ndarray, (H, W, spp, 3), float64
        Directions; not a number where nothing is seen.

    Returns
    -------
    outputs : Samples
        Depth is distance over 1 + distance.
    works : one, a row a tile
    """
    events = np.zeros((len(lists.starts) - 1, len(SampleRasterEvent)), np.int64)
    for_parts(
        _sample_raster, parts_of(-(-samples.height // tile)), normals, 0, 0, *lists, None, None, None,
        rays.astype(normals.dtype), volumes, samples, tile, simt.warp, events,
    )  # fmt: skip
    _add_traffic(events, simt, len(samples.offsets), PLANES_BYTES)
    return StageResult(samples, (_work(events, lists, samples, tile, "rays", PLANES_BYTES, 0),))


def _work(
    events: NDArray[np.int64], lists: MovingLists, samples: Samples, tile: int, variant: str, triangle_bytes: int,
    table: int,
) -> Work:  # fmt: skip
    """The launch, with what its warps read and write; ``table``: bytes of the samples' pattern, if it is read."""
    entries, pixels, spp = len(lists.entries), samples.width * samples.height, len(samples.offsets)
    drawn = triangle_bytes * len(np.unique(lists.entries))
    streams = [
        Stream("tile_lists", "load", 32 * entries, ENTRY_BYTES * entries),
        Stream("triangles", "load", triangle_bytes * entries, drawn),
        Stream("image", "store", PIXEL_BYTES * pixels, PIXEL_BYTES * pixels),
    ]
    if table:
        streams.append(Stream("pattern", "load", PATTERN_BYTES * pixels * spp, table))
    return raster_launch(events, tile, spp, variant, tuple(streams))


def raster_launch(
    events: NDArray[np.int64], tile: int, spp: int, variant: str, streams: tuple[Stream, ...] = ()
) -> Work:
    """A block a tile, a thread a pixel."""
    block = tile * tile
    shared_bytes = tile * tile * spp * SAMPLE_BYTES
    return Work(
        "sample_raster", SampleRasterEvent, events, block, shared_bytes=shared_bytes, streams=streams, variant=variant
    )


def _add_traffic(events: NDArray[np.int64], simt: Simt, spp: int, triangle_bytes: int) -> None:
    """Lanes of a warp read the same words of an entry; of the pattern and the image they read and write their own."""
    segment = smallest_transaction_bytes(int(simt.coalescing))
    warps = events[:, SampleRasterEvent.WARPS]
    reads = events[:, SampleRasterEvent.ENTRY_WARPS] * (1 + triangle_bytes // VECTOR_BYTES)
    if triangle_bytes == TRIANGLE_BYTES:  # lines of sight are computed
        reads += warps * spp * (PATTERN_BYTES * simt.warp // segment)
    writes = warps * max(1, PIXEL_BYTES * simt.warp // segment)
    events[:, SampleRasterEvent.LOAD_TRANSACTIONS] = reads
    events[:, SampleRasterEvent.LOAD_BYTES] = reads * segment
    events[:, SampleRasterEvent.STORE_TRANSACTIONS] = writes
    events[:, SampleRasterEvent.STORE_BYTES] = writes * segment


@kernel
def _sample_raster(
    part: int, parts: int, corners: Any, aperture: Any, focus: Any, starts: Any, entries: Any, masks: Any, place: Any,
    time_lens: Any, whole: Any, rays: Any, volumes: Any, samples: Samples, tile: int, warp: int, events: Any,
) -> None:  # fmt: skip
    rows, columns = (samples.height + tile - 1) // tile, (samples.width + tile - 1) // tile
    warps, spp = (tile * tile + warp - 1) // warp, len(samples.offsets)
    scratch = (
        np.empty((3, 3), corners.dtype), np.empty(3, corners.dtype), np.empty(2, corners.dtype),
        np.empty(2, corners.dtype), np.zeros(warps, np.int64),
    )  # fmt: skip
    for i in range(part * rows // parts * columns, (part + 1) * rows // parts * columns):
        row, listed = events[i], starts[i + 1] - starts[i]
        row[SampleRasterEvent.WARPS] = warps
        row[SampleRasterEvent.WARP_LANES] = tile * tile
        row[SampleRasterEvent.SAMPLES] = warps * spp
        row[SampleRasterEvent.ENTRIES] = listed
        row[SampleRasterEvent.ENTRY_WARPS] = warps * listed
        for at in range(starts[i], starts[i + 1]):
            for s in range(spp):
                if (masks[at] >> s) & 1:
                    row[SampleRasterEvent.MASKED_TESTS] += 1
                    row[SampleRasterEvent.TEST_WARPS] += warps
                    row[SampleRasterEvent.SAMPLE_TESTS] += tile * tile
                    _test(
                        corners, entries[at], aperture, focus, place, time_lens, whole, rays, volumes, samples, tile,
                        warp, i % columns * tile, i // columns * tile, s, scratch, row,
                    )  # fmt: skip


@kernel(lent=True)
def _test(
    corners: Any, p: int, aperture: Any, focus: Any, place: Any, time_lens: Any, whole: Any, rays: Any, volumes: Any,
    samples: Samples, tile: int, warp: int, x0: int, y0: int, s: int, scratch: Any, row: Any,
) -> None:  # fmt: skip
    """Test sample s of every pixel of a tile."""
    seen, weights, a, b, hits = scratch
    hits[:] = 0
    wide = 1 if place is None else place.shape[0]
    for y in range(y0, min(y0 + tile, samples.height)):
        i, j = y % wide, x0 % wide - 1  # of the pattern
        for x in range(x0, min(x0 + tile, samples.width)):
            j = j + 1 if j + 1 < wide else 0
            samples.tests[y, x] += 1
            depth = FAILS
            if place is not None:
                for d in range(2):
                    shift = aperture * time_lens[i, j, s, 1 + d]
                    a[d] = shift - (whole[x if d == 0 else y] + place[i, j, s, d])
                    b[d] = shift * focus
                seen_from(corners, p, time_lens[i, j, s, 0], a, b, seen)
                if covers(seen, weights):
                    depth = depth_of(corners, p, time_lens[i, j, s, 0], seen, weights)
            if rays is not None:
                depth = depth_along(corners, volumes, p, rays[y, x, s], weights)
            if depth >= 0:
                keep_nearest(samples, x, y, s, depth, p)
                hits[((y - y0) * tile + x - x0) // warp] += 1
    for w in range(len(hits)):
        row[SampleRasterEvent.SAMPLE_HITS] += hits[w]
        row[SampleRasterEvent.HIT_WARPS] += hits[w] > 0
