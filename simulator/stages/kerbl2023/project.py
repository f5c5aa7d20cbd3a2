"""Project: one thread a Gaussian finds its depth, its ellipse on the screen and the tiles of its square.

Three exits: nearer than 0.2, a determinant of exactly zero, no tile on the screen. What is culled has a radius of 0.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.splats import Splats
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.events import ProjectEvent
from tilestamp.simulator.stages.kerbl2023.gaussian import (
    NEAR,
    SLANT,
    Lens,
    covariance,
    on_screen,
    pixel,
    row_dot,
    three_sigmas,
)
from tilestamp.simulator.stages.kerbl2023.sectors import record_sectors
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles, square_tiles, to_int
from tilestamp.simulator.stages.laine2011.exact import fma
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
# What lanes touch: how far they have got (0 all, 1 behind the near test, 2 with a determinant, 3 visible), whether it
# is a store, bytes of a record, instructions, and the bytes of each. A matrix is the same for all lanes.
ACCESSES = (
    (0, 0, 12, 3, 4), (0, 1, 4, 1, 4), (0, 1, 4, 1, 4), (0, 0, 0, 4, 4),
    (1, 0, 0, 24, 4), (1, 0, 12, 3, 4), (1, 0, 12, 3, 4), (1, 0, 16, 4, 4), (1, 1, 24, 6, 4), (1, 0, 24, 5, 4),
    (3, 1, 4, 1, 4), (3, 1, 4, 1, 4), (3, 1, 4, 1, 4), (3, 1, 8, 1, 8), (3, 0, 4, 1, 4), (3, 1, 16, 1, 16),
)  # fmt: skip
BUFFERS = (
    "means", "radii", "tiles", "matrices",
    "matrices", "means", "scales", "rotations", "cov3d", "cov3d",
    "radii", "tiles", "depths", "positions", "opacities", "conics",
)  # fmt: skip
_PART = 1 << 14  # Gaussians, at least
_ZERO, _ONE, _TINY = np.float32(0), np.float32(1), np.float32(1e-7)
_E = ProjectEvent


class Projected(NamedTuple):
    """Gaussians on the screen; rows of those that are culled are zero.

    Parameters
    ----------
    radii : ndarray, (N,), int32
        Pixels; 0 where it is culled.
    tiles : ndarray, (N,), uint32
        Tiles that list it.
    depths : ndarray, (N,), float32
    positions : ndarray, (N, 2), float32
        Pixels; centres are whole numbers.
    conics : ndarray, (N, 4), float32
        A, B, C of the inverse covariance, and the opacity.
    """

    radii: NDArray[np.int32]
    tiles: NDArray[np.uint32]
    depths: NDArray[np.float32]
    positions: NDArray[np.float32]
    conics: NDArray[np.float32]


def lens_of(camera: Pinhole, width: int, height: int) -> Lens:
    """Give a camera with its screen as kernels take it."""
    two, tans = np.float32(2), (camera.tan_x, camera.tan_y)
    focal = (np.float32(width) / (two * tans[0]), np.float32(height) / (two * tans[1]))
    return Lens(camera.view, camera.proj_view, *focal, SLANT * tans[0], SLANT * tans[1], width, height)


@kernel(lent=True, error_model="numpy")
def _gaussian(
    i: int, means: Any, scales: Any, rotations: Any, opacities: Any, lens: Lens, tiles: Tiles, out: Any, space: Any
) -> int:
    """Project one; gives how far its thread gets: 0 too near, 1 determinant zero, 2 no tile, 3 stored."""
    x, y, z = means[i, 0], means[i, 1], means[i, 2]
    depth = row_dot(lens.to_camera, 2, x, y, z)
    if depth <= NEAR:
        return 0
    inverse = _ONE / (row_dot(lens.to_clip, 3, x, y, z) + _TINY)
    ndc_x = row_dot(lens.to_clip, 0, x, y, z) * inverse
    ndc_y = row_dot(lens.to_clip, 1, x, y, z) * inverse
    six = covariance(
        scales[i, 0], scales[i, 1], scales[i, 2],
        rotations[i, 0], rotations[i, 1], rotations[i, 2], rotations[i, 3],
    )  # fmt: skip
    if space is not None:
        for k in range(6):
            space[i, k] = six[k]
    cxx, cxy, cyy = on_screen(lens, x, y, z, depth, six)
    det = fma(cxx, cyy, -(cxy * cxy))
    if det == _ZERO:
        return 1
    inverse_det = _ONE / det
    radius = to_int(three_sigmas(cxx, cyy, det))
    px, py = pixel(ndc_x, lens.width), pixel(ndc_y, lens.height)
    c0, c1, r0, r1 = square_tiles(px, py, radius, tiles)
    count = (c1 - c0) * (r1 - r0)
    if count <= 0 or radius <= 0:  # of a covariance that is no number: 0, for which duplication writes nothing
        return 2
    out.radii[i], out.tiles[i], out.depths[i] = radius, count, depth
    out.positions[i, 0], out.positions[i, 1] = px, py
    out.conics[i, 0], out.conics[i, 1] = cyy * inverse_det, -(cxy * inverse_det)
    out.conics[i, 2], out.conics[i, 3] = cxx * inverse_det, opacities[i]
    return 3


@kernel(lent=True)
def _count_warp(first: int, lanes: int, reached: Any, active: Any, segment: int, row: Any) -> None:
    """Events of one warp, whose lanes got as far as ``reached`` says."""
    row[_E.WARPS] += 1
    row[_E.GAUSSIANS] += lanes
    far = square = visible = 0
    for lane in range(lanes):
        far += reached[lane] > 0
        square += reached[lane] > 1
        visible += reached[lane] > 2
    row[_E.NEAR_WARPS] += far > 0
    row[_E.NEAR_LANES] += far
    row[_E.SQUARE_WARPS] += square > 0
    row[_E.SQUARE_LANES] += square
    row[_E.VISIBLE_WARPS] += visible > 0
    row[_E.VISIBLE] += visible
    row[_E.CULLED_NEAR] += lanes - far
    row[_E.CULLED_DETERMINANT] += far - square
    row[_E.CULLED_SCREEN] += square - visible
    for level in range(4):
        for lane in range(len(active)):
            active[lane] = lane < lanes and reached[lane] >= level
        for record in ACCESSES:
            if record[0] == level:
                n = record_sectors(active, len(active), first, record[2], record[3], record[4], segment)
                if record[1]:
                    row[_E.STORE_TRANSACTIONS] += n
                else:
                    row[_E.LOAD_TRANSACTIONS] += n


@kernel
def _project(
    part: int, parts: int, means: Any, scales: Any, rotations: Any, opacities: Any, lens: Lens, tiles: Tiles,
    warp: int, segment: int, out: Any, space: Any, table: Any,
) -> None:  # fmt: skip
    count = len(means)
    blocks = (count + BLOCK - 1) // BLOCK
    reached, active = np.zeros(warp, np.int64), np.zeros(warp, np.int64)
    for block in range(blocks * part // parts, blocks * (part + 1) // parts):
        end = min((block + 1) * BLOCK, count)
        for first in range(block * BLOCK, end, warp):
            lanes = min(warp, end - first)
            for lane in range(lanes):
                reached[lane] = _gaussian(first + lane, means, scales, rotations, opacities, lens, tiles, out, space)
            if table is not None:
                _count_warp(first, lanes, reached, active, segment, table[block])
        if table is not None:
            table[block, _E.BLOCKS] = 1
            table[block, _E.LOAD_BYTES] = table[block, _E.LOAD_TRANSACTIONS] * segment
            table[block, _E.STORE_BYTES] = table[block, _E.STORE_TRANSACTIONS] * segment


def project(
    splats: Splats,
    camera: Pinhole,
    tiles: Tiles,
    simt: Simt,
    *,
    counting: bool = True,
    space: NDArray[np.float32] | None = None,
) -> StageResult[Projected]:
    """Project all Gaussians.

    Parameters
    ----------
    splats : Splats
    camera : Pinhole
    tiles : Tiles
    simt : Simt
    counting : bool
    space : ndarray, (N, 6), float32, optional
        Gets the covariances in space, 00 01 02 11 12 22, of all behind the near test.

    Returns
    -------
    outputs : Projected
    works : one, a row a block
    """
    count = len(splats)
    out = Projected(
        np.zeros(count, np.int32), np.zeros(count, np.uint32), np.zeros(count, np.float32),
        np.zeros((count, 2), np.float32), np.zeros((count, 4), np.float32),
    )  # fmt: skip
    blocks = -(-count // BLOCK)
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    inputs = (splats.means, splats.scales, splats.rotations, splats.opacities)
    lens = lens_of(camera, tiles.width, tiles.height)
    shape = (simt.warp, smallest_transaction_bytes(int(simt.coalescing)))
    for_parts(_project, parts_of(blocks, _PART // BLOCK), *inputs, lens, tiles, *shape, out, space, table)
    return StageResult(out, () if table is None else (project_work(table),))


def project_work(table: NDArray[np.int64]) -> Work:
    """Work of the kernel, from the rows of its blocks."""
    total = table.sum(axis=0)
    streams = []
    for (level, stored, stride, words, size), name in zip(ACCESSES, BUFFERS, strict=True):
        lanes = int(total[(_E.GAUSSIANS, _E.NEAR_LANES, _E.SQUARE_LANES, _E.VISIBLE)[level]])
        if stride:
            streams.append(Stream(name, "store" if stored else "load", lanes * words * size, lanes * stride))
    return Work("project", _E, table, BLOCK, streams=tuple(streams))
