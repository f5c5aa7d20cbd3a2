"""Screen-space ambient occlusion (Ru 2016, "SSAO"): 64 samples, 4x4 noise, linear depth.

Samples of the upper hemisphere are turned about its axis by the noise of the pixel, lifted to the eye-space normal,
and projected; a sample is occluded if the pixel there is before it. "Need to use linear depth." A second kernel blurs
(``occlusion_blur``). Instructions are those of the screen, whatever the scene; memory is read where something is drawn:
a sample's fragment lies in a sector of its own. The sample pattern, the radius and
the range check are ours: he names none.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.fragment_shading import Fragments
from tilestamp.simulator.stages.ru2016.fragment_shading_work import BLOCK, by_warp
from tilestamp.simulator.stages.ru2016.occlusion_blur import occlusion_blur
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from tilestamp.simulator.stages.ru2016.vertex_shading import SHIFTS, EyeSpace, Samples
from tilestamp.simulator.stages.thread_per_item import Access, ThreadEvent, thread_per_item
from tilestamp.simulator.work import Work

SAMPLES = 64
SAMPLED = 100  # sectors that a drawn pixel reads besides: 64 samples and what they are compared with (H200: 94 to 112)
FRAGMENT_WORDS = 7
NOISE = 4  # pixels on a side of the noise texture
RADIUS = 0.05  # of the distance from the eye
BIAS = np.float32(0.02)  # of the radius: a surface does not occlude itself
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


def hemisphere() -> NDArray[np.float32]:
    """Give the sample pattern, (SAMPLES, 3): a Hammersley set in the upper half ball, denser near its centre."""
    i = np.arange(SAMPLES)
    bits = np.array([int(f"{k:06b}"[::-1], 2) for k in i]) / SAMPLES
    angle, height = 2.0 * np.pi * (i + 0.5) / SAMPLES, 0.1 + 0.9 * (bits + 0.5 / SAMPLES)
    flat = np.sqrt(np.maximum(0.0, 1.0 - height**2))
    length = 0.1 + 0.9 * ((i * 37 % SAMPLES + 0.5) / SAMPLES) ** 2
    directions = np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)
    return (directions * length[:, None]).astype(np.float32)


def noise() -> NDArray[np.float32]:
    """Give the turns of the 4x4 noise texture, (4, 4, 2): cosine and sine, every sixteenth of a turn once."""
    order = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) / 16.0
    return np.stack([np.cos(2.0 * np.pi * order), np.sin(2.0 * np.pi * order)], axis=2).astype(np.float32)


@kernel(error_model="numpy", lent=True)
def _occluded(
    w: Any, normal: Any, turn: Any, samples: Any, scales: Any, shift: Any, x: int, y: int, radius: Any
) -> int:
    """Count the samples of one pixel that lie behind what is drawn there."""
    height, width = w.shape
    distance = w[y, x] / scales[2]
    px = ((np.float32(x) + _HALF - shift[0]) / np.float32(width) * np.float32(2.0) - _ONE) * w[y, x] / scales[0]
    py = (_ONE - (np.float32(y) + _HALF - shift[1]) / np.float32(height) * np.float32(2.0)) * w[y, x] / scales[1]
    nx, ny, nz = normal[0], normal[1], normal[2]
    # a frame around the normal (Duff et al. 2017)
    sign = _ONE if nz >= _ZERO else -_ONE
    a = -_ONE / (sign + nz)
    b = nx * ny * a
    occluded = 0
    for i in range(len(samples)):
        u = (samples[i, 0] * turn[0] - samples[i, 1] * turn[1]) * radius
        v = (samples[i, 0] * turn[1] + samples[i, 1] * turn[0]) * radius
        n = samples[i, 2] * radius
        sx = px + u * (_ONE + sign * nx * nx * a) + v * b + n * nx
        sy = py + u * sign * b + v * (sign + ny * ny * a) + n * ny
        deep = distance - (-u * sign * nx - v * ny + n * nz)
        if deep <= _ZERO:
            continue
        column = int(np.floor((sx * scales[0] / (deep * scales[2]) + _ONE) * _HALF * np.float32(width) + shift[0]))
        line = int(np.floor((_ONE - sy * scales[1] / (deep * scales[2])) * _HALF * np.float32(height) + shift[1]))
        if 0 <= column < width and 0 <= line < height and w[line, column] > _ZERO:
            drawn = w[line, column] / scales[2]
            if drawn < deep - BIAS * radius and distance - drawn < radius:
                occluded += 1
    return occluded


@kernel(error_model="numpy", lent=True)
def _row(
    w: Any, normals: Any, turns: Any, samples: Any, scales: Any, shift: Any, relative: Any, y: int, light: Any
) -> None:
    """Light of one row of pixels."""
    for x in range(w.shape[1]):
        if w[y, x] > _ZERO:
            radius = relative * w[y, x] / scales[2]
            found = _occluded(w, normals[y, x], turns[y % NOISE, x % NOISE], samples, scales, shift, x, y, radius)
            light[y, x] = _ONE - np.float32(found) / np.float32(len(samples))


@kernel(error_model="numpy", lent=True)
def _ambient_occlusion(
    part: int, parts: int, w: Any, normals: Any, turns: Any, samples: Any, scales: Any, shift: Any, relative: Any,
    light: Any,
) -> None:  # fmt: skip
    """Light of a share of the rows."""
    for y in range(part * len(w) // parts, (part + 1) * len(w) // parts):
        _row(w, normals, turns, samples, scales, shift, relative, y, light)


def ambient_occlusion(
    fragments: Fragments, eye: EyeSpace, simt: Simt, *, samples: Samples = "centers"
) -> StageResult[NDArray[np.float32]]:
    """Find how much light reaches each pixel.

    Parameters
    ----------
    fragments : Fragments
    eye : EyeSpace
    simt : Simt
    samples : {"centers", "corners"}
        Where in its pixel a fragment lies (``vertex_shading``).

    Returns
    -------
    outputs : ndarray, (H, W), float32
        Share of the light that is left: 1 where nothing occludes; blurred.
    works : the occlusion and the blur

    Raises
    ------
    TilestampError
        The camera is a parallel projection: there is no linear depth along w.
    """
    if eye.scales[2] == 0.0:
        raise TilestampError("ambient occlusion needs a perspective camera, this one is a parallel projection")
    light = np.ones(fragments.w.shape, np.float32)
    for_parts(
        _ambient_occlusion, parts_of(len(light)), fragments.w, fragments.normals, noise(), hemisphere(), eye.scales,
        SHIFTS[samples], np.float32(RADIUS), light,
    )  # fmt: skip
    occlusion = _work(fragments.w > _ZERO, simt)
    light, blur, _ = occlusion_blur(light, simt)
    return StageResult(light, (occlusion, *blur))


def _work(drawn: NDArray[np.bool_], simt: Simt) -> Work:
    """A thread a pixel; the samples' directions are the same words for all lanes."""
    loads, stores = (Access("fragments", FRAGMENT_BYTES, FRAGMENT_WORDS),), (Access("fragments", FRAGMENT_BYTES, 1),)
    by_block = by_warp(drawn).reshape(-1, BLOCK).sum(axis=1)
    idle = len(by_block) - -(-drawn.size // BLOCK)  # blocks of 8x8 that the picture's edges cut
    work = thread_per_item("ambient_occlusion", "ambient_occlusion", drawn.size, BLOCK, simt, loads, stores, idle)
    segment = smallest_transaction_bytes(int(simt.coalescing))
    sampled = SAMPLED * by_block
    read = 3 * SAMPLES * work.table[:, ThreadEvent.WARPS] + sampled
    work.table[:, ThreadEvent.LOAD_TRANSACTIONS] += read
    work.table[:, ThreadEvent.LOAD_BYTES] += segment * read
    total = segment * int(sampled.sum())
    fetched = Stream(
        "fragments", "load", total, min(total, FRAGMENT_BYTES * drawn.size), partial_lines=total // segment
    )
    return replace(work, streams=(*work.streams, fetched))
