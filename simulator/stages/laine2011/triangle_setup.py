"""Triangle setup: one thread an input triangle, culls, clips, snaps and writes sub-triangles (cudaraster, first stage).

Two published releases: "1.1" (Laine & Karras 2011) has a guard band in x and y and culls backfaces; "nvdiffrast"
(2022) clips whatever leaves the frustum and keeps backfaces unless told otherwise.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.subtriangle import View
from tilestamp.simulator.stages.laine2011.triangle_setup_count import (
    TriangleSetupEvent,
    count_lane,
    count_paths,
    count_warp,
    new_counting,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import (
    CLIPPED,
    OUTSIDE,
    Scratch,
    Setup,
    clip_and_store,
    fast_path,
    load_corners,
    new_scratch,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_streams import setup_streams
from tilestamp.simulator.work import Work

Release = Literal["1.1", "nvdiffrast"]

BLOCK = 64  # threads, a triangle each
WARP = 32
SHARED_BYTES = 4608  # the clip polygons of 64 threads
SLACK = 4096  # sub-triangle slots beyond one for each triangle, at first
MAX_SUBTRIANGLES = 2**24
MAX_SIZE = 2048  # pixels along an axis: 16 bins of 16 tiles of 8 pixels
SUBTRIANGLE_BYTES = {"1.1": 81, "nvdiffrast": 33}  # count 1, header 16, data 64 or 16
_PART_BLOCKS = 64  # blocks that one call of the worker takes, at least


@kernel
def _setup_range(
    begin: int,
    end: int,
    positions: Any,
    triangles: Any,
    view: View,
    simt: Simt,
    out: Setup,
    scratch: Scratch,
    counting: Any,
    table: Any,
) -> None:
    """All triangles of some whole blocks; those with two or more sub-triangles are only counted here."""
    clip = scratch.clip
    for warp in range(begin, end, WARP):
        last = min(warp + WARP, end)
        allocating = np.int64(0)  # a literal that changes in a loop has its callees compiled twice
        if table is not None:
            counting.longest[:] = 0
            counting.paths[:] = 0
        for t in range(warp, last):
            out.first[t] = t
            kept, fan, outcome, sites = 0, 0, OUTSIDE, 0
            in_range = load_corners(positions, triangles, t, clip)
            if in_range:
                outcome, sites = fast_path(clip, view, out, t, triangles)
                kept = 1 if outcome == 0 else 0
            if outcome == CLIPPED:
                kept, fan = clip_and_store(scratch, view, out, -1, t, triangles)
                allocating += 1 if kept >= 2 else 0
            out.subtriangles[t] = kept
            if table is not None:
                counting.read[t - warp] = in_range
                count_lane(table[warp // BLOCK], counting, outcome, kept, fan, scratch.steps)
                count_paths(counting.paths, clip, in_range, outcome, sites, scratch.steps)
        if table is not None:
            row = table[warp // BLOCK]
            count_warp(row, allocating, counting, triangles, warp, last - warp, view, out, simt)


@kernel
def _setup_part(
    part: int, parts: int, positions: Any, triangles: Any, view: View, simt: Simt, out: Setup, table: Any
) -> None:
    """Take a share of the blocks, through arrays without reference counts."""
    blocks = (triangles.shape[0] + BLOCK - 1) // BLOCK
    begin, end = blocks * part // parts * BLOCK, min(blocks * (part + 1) // parts * BLOCK, triangles.shape[0])
    scratch, counting = new_scratch(), new_counting()
    positions, triangles, out, lent = borrow(positions), borrow(triangles), borrow(out), borrow(scratch)
    _setup_range(begin, end, positions, triangles, view, simt, out, lent, borrow(counting), borrow(table))
    scratch.steps[0] = counting.value[0] = 0  # the owners live to here


@kernel
def _setup_several(several: Any, positions: Any, triangles: Any, view: View, out: Setup) -> None:
    """Write the sub-triangles of the triangles that have two or more, to the slots allocated for them."""
    scratch = new_scratch()
    clip = scratch.clip
    for t in several:
        load_corners(positions, triangles, t, clip)
        out.misc[t] = out.first[t]
        clip_and_store(scratch, view, out, out.first[t], t, triangles)


def as_published(switch: bool | None, release: Release) -> bool:
    """Whether culling of backfaces and the guard band are on: in 1.1, and not in nvdiffrast, where nothing is said."""
    return release == "1.1" if switch is None else switch


def make_view(
    width: int,
    height: int,
    *,
    release: Release,
    samples: int = 1,
    cull_backfaces: bool | None = None,
    depth: bool = True,
    interpolate: bool = True,
    guard_band: bool | None = None,
) -> View:
    """Check the viewport, and put the switches of a draw in the form that kernels take."""
    if not (1 <= width <= MAX_SIZE and 1 <= height <= MAX_SIZE):
        raise TilestampError(
            f"size {width}x{height}: cudaraster draws 1 to {MAX_SIZE} pixels along an axis, as the original"
        )
    return View(
        half_width=8 * width,
        half_height=8 * height,
        scale_x=np.float32(8 * width),
        scale_y=np.float32(8 * height),
        log_samples=samples.bit_length() - 1,
        guard_band=as_published(guard_band, release),
        cull_backfaces=as_published(cull_backfaces, release),
        depth=depth,
        interpolate=interpolate and release == "1.1",
    )


def check_mesh(positions: NDArray[Any], triangles: NDArray[Any], *, release: Release) -> None:
    """Refuse arrays of other shapes and types, and indices that the release would not survive."""
    if positions.ndim != 2 or positions.shape[1] != 4 or positions.dtype != np.float32:
        raise TilestampError(
            f"positions are {positions.dtype} {positions.shape}; float32 (V, 4) in clip space is needed"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype != np.int32:
        raise TilestampError(f"triangles are {triangles.dtype} {triangles.shape}; int32 (F, 3) is needed")
    if len(triangles) > MAX_SUBTRIANGLES:
        raise TilestampError(f"{len(triangles)} triangles: cudaraster takes at most {MAX_SUBTRIANGLES} a draw")
    if release == "1.1" and len(triangles) and (triangles.min() < 0 or triangles.max() >= len(positions)):
        bad = int(np.flatnonzero(((triangles < 0) | (triangles >= len(positions))).any(axis=1))[0])
        raise TilestampError(f"triangle {bad} has a vertex index out of range; the mesh has {len(positions)} vertices")


def triangle_setup(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    samples: int = 1,
    cull_backfaces: bool | None = None,
    depth: bool = True,
    interpolate: bool = True,
    guard_band: bool | None = None,
    counting: bool = True,
    capacity: int | None = None,
    variant: str = "",
) -> StageResult[Setup]:
    """Cull, clip and set up all triangles of one draw.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Viewport, pixels, at most 2048.
    simt : Simt
        Coalescing rule for the counts.
    release : {"1.1", "nvdiffrast"}
    samples : int
        1, 2, 4 or 8 samples a pixel (nvdiffrast: 1).
    cull_backfaces : bool or None
        None: as published, on in 1.1, off in nvdiffrast.
    depth, interpolate : bool
        Whether the depth plane and the attribute planes are needed.
    guard_band : bool or None
        Leave triangles whole that leave the screen by little; None: in 1.1.
    counting : bool
        Off: the work table stays empty.
    capacity : int or None
        Slots; None: F + 4096. Where more are needed nothing is lost: ``facts["numSubtris"]`` says how many, and the
        caller draws again.
    variant : str
        How the kernel was compiled.

    Returns
    -------
    outputs : Setup
    works : one, a row a block of 64 threads
    facts : dict
        ``numSubtris``, ``capacity`` and ``overflow``.

    Raises
    ------
    TilestampError
        Shapes, types, sizes; for release 1.1 also indices out of range (nvdiffrast skips such triangles).
    """
    view = make_view(
        width,
        height,
        release=release,
        samples=samples,
        cull_backfaces=cull_backfaces,
        depth=depth,
        interpolate=interpolate,
        guard_band=guard_band,
    )
    check_mesh(positions, triangles, release=release)
    F = len(triangles)
    out = _empty_setup(F, F, release)
    table = np.zeros((-(-F // BLOCK) if counting else 0, len(TriangleSetupEvent)), np.int64)
    with np.errstate(all="ignore"):
        parts = parts_of(-(-F // BLOCK), _PART_BLOCKS)
        for_parts(_setup_part, parts, positions, triangles, view, simt, out, table if counting else None)
        several = np.flatnonzero(out.subtriangles >= 2)
        counts = out.subtriangles[several].astype(np.int64)
        needed = F + int(counts.sum())
        capacity = F + SLACK if capacity is None else capacity
        if len(several) and needed <= capacity:
            out = _grown(out, needed)
            out.first[several] = F + np.cumsum(counts) - counts
            _setup_several(several, positions, triangles, view, out)
    streams = setup_streams(positions, triangles, out, view, BLOCK)
    work = Work(
        stage="triangle_setup",
        kernel="triangleSetup",
        events=TriangleSetupEvent,
        table=table,
        grid=-(-F // BLOCK),
        block=BLOCK,
        shared_bytes=SHARED_BYTES,
        streams=streams,
        variant=variant,
    )
    facts = {"numSubtris": needed, "capacity": capacity, "overflow": needed > capacity}
    return StageResult(out, (work,) if counting else (), facts)


def _empty_setup(F: int, slots: int, release: Release) -> Setup:
    return Setup(
        subtriangles=np.zeros(F, np.uint8),
        first=np.empty(F, np.int32),
        headers=np.zeros((slots, 6), np.int16),
        misc=np.zeros(slots, np.uint32),
        planes=np.zeros((slots, 16 if release == "1.1" else 4), np.uint32),
        inputs=np.zeros(slots, np.int32),
    )


def _grown(setup: Setup, slots: int) -> Setup:
    """Make room for more slots."""
    longer = [np.concatenate([a, np.zeros((slots - len(a), *a.shape[1:]), a.dtype)]) for a in setup[2:]]
    return Setup(setup.subtriangles, setup.first, *longer)
