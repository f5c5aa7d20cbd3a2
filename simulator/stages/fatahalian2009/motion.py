"""Motion blur and defocus: micropolygons that move, seen through a thin lens, at samples in x, y, time and lens.

Both algorithms are parallel across polygons: a warp draws as many as it has lanes, a polygon a lane, and its lanes step
through their samples together, so that a warp runs as long as its longest lane.
A vertex moves on a straight line on screen while the shutter is open, and is displaced by its circle of confusion times
the lens position (Fatahalian et al. 2009; Cook et al. 1987). A sample is a place in its pixel, a time in [0, 1] and a
point of the unit disc. The pattern of samples is a tile that repeats over the screen.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import shown
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import set_up
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import (
    Samples,
    count_hit_warp,
    hit_columns,
    new_samples,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS
from tilestamp.simulator.stages.fatahalian2009.warp_queue import sample_streams, warp_queue
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import Work

STEPS = 64  # that a lane walks ahead before the others do
CORNER_BYTES = 28  # start, end and circle of confusion of a vertex
MOST_SAMPLES = 1024  # a pixel


@shown(*SAMPLE_COUNTERS)
class MotionEvent(IntEnum):
    """Events of one warp of moving polygons."""

    WARPS = 0  # one a unit: it draws polygons, a lane each
    POLYGONS = 1
    BOXES = 2  # of a polygon: over an interval of time and lens, or placed at one time and lens point and set up
    BOX_WARPS = 3
    SAMPLE_TESTS = 4
    TEST_WARPS = 5  # warp executions of the sample test; that of intervals places and sets up its polygons first
    SAMPLE_HITS = 6
    HIT_WARPS = 7  # warp executions of depth and atomic
    ATOMIC_LANES = 8
    ATOMIC_REQUESTS = 9
    ATOMIC_CONFLICTS = 10
    ATOMIC_DEPTH = 11
    LOAD_TRANSACTIONS = 12
    LOAD_BYTES = 13


HITS = hit_columns(MotionEvent)


class MovingMicropolygons(NamedTuple):
    """Polygons at both ends of the shutter interval.

    Parameters
    ----------
    start, end : ndarray, (M, 3 or 4, 3), float32
        As the vertices of ``Micropolygons``.
    blur : ndarray, (M, 3 or 4), float32
        Radius of each vertex's circle of confusion in pixels.
    """

    start: NDArray[np.float32]
    end: NDArray[np.float32]
    blur: NDArray[np.float32]


class BlurPattern(NamedTuple):
    """Samples of a tile of pixels that repeats over the screen.

    Parameters
    ----------
    place : ndarray, (T, T, spp, 2), int64
        x and y in the pixel, sub-pixel steps; indexed by row and column of the pixel.
    time_lens : ndarray, (T, T, spp, 3), float64
        Time, and lens u and v.
    """

    place: NDArray[np.int64]
    time_lens: NDArray[np.float64]


def moved(polygons: Micropolygons, way: ArrayLike, blur: ArrayLike = 0.0) -> MovingMicropolygons:
    """Let polygons move ``way`` pixels (x, y) while the shutter is open, with circles of confusion of radius ``blur``.

    Parameters
    ----------
    polygons : Micropolygons
    way : array-like, (2,), or one for each vertex
    blur : float, or one for each vertex
        Pixels.
    """
    start = polygons.vertices
    end = start.copy()
    end[..., :2] += np.asarray(way, np.float32)
    return MovingMicropolygons(start, end, np.broadcast_to(np.asarray(blur, np.float32), start.shape[:2]).copy())


def stratified_pattern(spp: int, tile: int = 32, seed: int = 7) -> BlurPattern:
    """Make samples for intervals: sample s of every pixel lies in stratum s of time, of the lens, and of the pixel.

    The strata of time and lens are paired by bit reversal, so that they do not go hand in hand.
    """
    if not 1 <= spp <= MOST_SAMPLES:
        raise TilestampError(f"spp is 1 to {MOST_SAMPLES} samples a pixel, not {spp}")
    random = np.random.default_rng(seed).random((tile, tile, spp, 5))
    s = np.arange(spp)
    time = (s + random[..., 0]) / spp
    lens = _disc((s + random[..., 1]) / spp, (_reversed_bits(s, 2) + random[..., 2] / spp) % 1.0)
    place = np.stack(
        [(_reversed_bits(s, 3) + random[..., 3]) % 1.0, (_reversed_bits(s, 5) + random[..., 4]) % 1.0], axis=-1
    )
    order = np.argsort(_reversed_bits(s, 2), kind="stable")
    return BlurPattern(
        np.floor(place * SUBPIXELS).astype(np.int64),
        np.ascontiguousarray(np.concatenate([time[..., None], lens[..., order, :]], axis=-1)),
    )


def interleaved_pattern(spp: int, tile: int = 4, seed: int = 7) -> BlurPattern:
    """Make samples for interleaving: as many distinct times and lens points as a tile has samples, each once."""
    if not 1 <= spp <= MOST_SAMPLES:
        raise TilestampError(f"spp is 1 to {MOST_SAMPLES} samples a pixel, not {spp}")
    rng = np.random.default_rng(seed)
    count = tile * tile * spp
    n = np.arange(count)
    time = (n + 0.5) / count
    lens = _disc(_reversed_bits(n, 2), _reversed_bits(n, 3))
    values = np.concatenate([time[:, None], lens], axis=1)
    strata = np.argsort(rng.random((spp, tile * tile)), axis=1) + tile * tile * np.arange(spp)[:, None]
    place = rng.random((tile, tile, spp, 2))
    return BlurPattern(
        np.floor(place * SUBPIXELS).astype(np.int64), np.ascontiguousarray(values[strata.T].reshape(tile, tile, spp, 3))
    )


def blur_samples(width: int, height: int, pattern: BlurPattern) -> Samples:
    """Empty sample buffers for a pattern."""
    return new_samples(width, height, np.zeros((pattern.place.shape[2], 2), np.int64))


def _disc(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the unit square as points of the unit disc of equal area, (..., 2): radius by a, angle by b."""
    a, b = np.broadcast_arrays(a, b)
    points: NDArray[np.float64] = np.sqrt(a)[..., None] * np.stack(
        [np.cos(2 * np.pi * b), np.sin(2 * np.pi * b)], axis=-1
    )
    return points


def _reversed_bits(n: NDArray[np.int64], base: int) -> NDArray[np.float64]:
    """Radical inverse of whole numbers."""
    result, scale, rest = np.zeros(len(n)), 1.0 / base, n.copy()
    while rest.any():
        result += scale * (rest % base)
        rest //= base
        scale /= base
    return result


def motion_table(polygons: MovingMicropolygons, simt: Simt) -> NDArray[np.int64]:
    """Empty work table: a row for each warp of polygons."""
    return np.zeros((-(-len(polygons.start) // simt.warp), len(MotionEvent)), np.int64)


def motion_work(
    kernel: str, table: NDArray[np.int64], polygons: MovingMicropolygons, samples: Samples, simt: Simt, *more: Stream
) -> Work:
    """Make the launch of either algorithm: persistent warps that draw polygons from a queue; ``more``: other loads."""
    streams = sample_streams(sum(array.nbytes for array in polygons), samples, MotionEvent, table, *more)
    return warp_queue(kernel, MotionEvent, table, simt, streams=streams, atomic_requests=samples.requests)


def empty_work(kernel: str, simt: Simt) -> Work:
    """Launch of either algorithm, without rows."""
    return warp_queue(kernel, MotionEvent, np.zeros((0, len(MotionEvent)), np.int64), simt)


@kernel(lent=True)
def begin_warp(first: int, last: int, corners: int, simt: Simt, row: Any) -> None:
    """Count the loads of a warp's polygons, first..last-1."""
    row[MotionEvent.WARPS] += 1
    row[MotionEvent.POLYGONS] += last - first
    size = corners * CORNER_BYTES
    count, total = contiguous(first * size, (last - first) * size, simt.coalescing)
    row[MotionEvent.LOAD_TRANSACTIONS] += count
    row[MotionEvent.LOAD_BYTES] += total


@kernel(lent=True)
def count_atomic(samples: Samples, addresses: Any, hits: int, simt: Simt, row: Any) -> None:
    """Count the atomics of the hits of one warp execution of the sample test."""
    count_hit_warp(samples, addresses, hits, simt, row, HITS)


@kernel(lent=True)
def put(start: Any, end: Any, blur: Any, p: int, time: Any, u: Any, v: Any, polygon: Any) -> None:
    """Write polygon p as it stands at a time and a lens point to ``polygon`` (3 or 4, 3)."""
    for k in range(start.shape[1]):
        for d in range(3):
            polygon[k, d] = start[p, k, d] + time * (end[p, k, d] - start[p, k, d])
        polygon[k, 0] += blur[p, k] * u
        polygon[k, 1] += blur[p, k] * v


@kernel(lent=True)
def set_up_at(start: Any, end: Any, blur: Any, p: int, time_lens: Any, polygon: Any, setup: Any) -> None:
    """Place a polygon and set it up."""
    put(start, end, blur, p, time_lens[0], time_lens[1], time_lens[2], polygon)
    set_up(polygon, setup[0], setup[1], setup[2], setup[3])
