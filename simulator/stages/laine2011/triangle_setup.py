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
from tilestamp.simulator.stages.laine2011.screen_vertices import BEYOND, Screen, screen_vertices
from tilestamp.simulator.stages.laine2011.subtriangle import ABSENT, CLIPPED, KEPT, View
from tilestamp.simulator.stages.laine2011.triangle_setup_count import (
    FIRST_OUTSIDE,
    ONE_SITE,
    TWO_SITES,
    WARP,
    TriangleSetupEvent,
    count_clipped,
    count_vertices,
    count_warp,
    new_counting,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import (
    Scratch,
    Setup,
    clip_and_store,
    new_scratch,
    store_whole,
    whole_outcome,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_streams import setup_streams
from tilestamp.simulator.work import Work

Release = Literal["1.1", "nvdiffrast"]

BLOCK = 64  # threads, a triangle each
SHARED_BYTES = 4608  # the clip polygons of 64 threads
SLACK = 4096  # sub-triangle slots beyond one for each triangle, at first
MAX_SUBTRIANGLES = 2**24
MAX_SIZE = 2048  # pixels along an axis: 16 bins of 16 tiles of 8 pixels
SUBTRIANGLE_BYTES = {"1.1": 81, "nvdiffrast": 33}  # count 1, header 16, data 64 or 16
_PART_BLOCKS = 64  # blocks that one call of the worker takes, at least


@kernel(lent=True)
def _setup_range(
    begin: int,
    end: int,
    screen: Screen,
    positions: Any,
    triangles: Any,
    view: View,
    simt: Simt,
    out: Setup,
    scratch: Scratch,
    counting: Any,
    vertices: Any,
    table: Any,
) -> None:
    """All triangles of some whole blocks; those with two or more sub-triangles are only counted here.

    Records follow each other from the first triangle's own place on.
    """
    record = np.int64(begin)
    for warp in range(begin, end, WARP):
        last = min(warp + WARP, end)
        for t in range(warp, last):
            outcome, area, sites = whole_outcome(screen, triangles, t, view)
            kept = fan = 0
            if outcome == KEPT:
                kept = 1
                store_whole(screen, positions, triangles, t, record, area, view, out)
            elif outcome == CLIPPED:
                kept, fan = clip_and_store(scratch, positions, view, out, np.int64(-1), record, t, triangles)
            out.subtriangles[t] = kept
            record += kept == 1
            if table is not None:
                bit = 1 << (t - warp)
                counting.lanes[outcome] |= bit
                if sites > 0:
                    counting.lanes[ONE_SITE] |= bit
                    counting.lanes[TWO_SITES] |= bit if sites > 1 else 0
                if outcome == CLIPPED:
                    count_clipped(counting, bit, kept, fan, scratch.steps)
                if outcome != ABSENT and screen.codes[triangles[t, 0]] & BEYOND:
                    counting.lanes[FIRST_OUTSIDE] |= bit
        if table is not None:
            row = table[warp // BLOCK]
            count_vertices(row, vertices, counting, triangles, warp, last - warp, warp // BLOCK, simt)
            count_warp(row, counting, last - warp, view, out, simt)


@kernel
def _setup_part(
    part: int,
    parts: int,
    screen: Screen,
    positions: Any,
    triangles: Any,
    view: View,
    simt: Simt,
    out: Setup,
    vertices: Any,
    table: Any,
) -> None:
    """Take a share of the blocks, through arrays without reference counts."""
    blocks = (triangles.shape[0] + BLOCK - 1) // BLOCK
    begin, end = blocks * part // parts * BLOCK, min(blocks * (part + 1) // parts * BLOCK, triangles.shape[0])
    scratch, counting = new_scratch(), new_counting()
    screen, positions, triangles, out = borrow(screen), borrow(positions), borrow(triangles), borrow(out)
    lent, counted = borrow(scratch), (borrow(counting), borrow(vertices[part]))
    _setup_range(begin, end, screen, positions, triangles, view, simt, out, lent, *counted, borrow(table))
    scratch.steps[0] = counting.most[0] = 0  # the owners live to here


@kernel
def _setup_several(several: Any, positions: Any, triangles: Any, view: View, out: Setup) -> None:
    """Write the sub-triangles of the triangles that have two or more, to the slots allocated for them."""
    scratch = new_scratch()
    for t in several:
        first = np.int64(out.misc[t])
        clip_and_store(scratch, positions, view, out, first, first, t, triangles)


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
        screen = screen_vertices(positions, triangles, view)
        parts = parts_of(-(-F // BLOCK), _PART_BLOCKS)
        vertices = np.zeros((parts, 2), np.int64)
        for_parts(
            _setup_part, parts, screen, positions, triangles, view, simt, out, vertices, table if counting else None
        )
        several = np.flatnonzero(out.subtriangles >= 2)
        counts = out.subtriangles[several].astype(np.int64)
        needed = F + int(counts.sum())
        capacity = F + SLACK if capacity is None else capacity
        if len(several) and needed <= capacity:
            out = _grown(out, needed)
            out.misc[several] = F + np.cumsum(counts) - counts
            _setup_several(several, positions, triangles, view, out)
    facts = {"numSubtris": needed, "capacity": capacity, "overflow": needed > capacity}
    if not counting:
        return StageResult(out, (), facts)
    work = Work(
        stage="triangle_setup",
        kernel="triangleSetup",
        events=TriangleSetupEvent,
        table=table,
        grid=-(-F // BLOCK),
        block=BLOCK,
        shared_bytes=SHARED_BYTES,
        streams=setup_streams(out, len(positions), vertices.sum(axis=0), view),
        variant=variant,
    )
    return StageResult(out, (work,), facts)


def _empty_setup(F: int, slots: int, release: Release) -> Setup:
    return Setup(
        subtriangles=np.zeros(F, np.uint8),
        headers=np.zeros((slots, 6), np.int16),
        misc=np.zeros(slots, np.uint32),
        records=np.zeros(slots, np.int32),
        planes=np.zeros((slots, 16 if release == "1.1" else 4), np.uint32),
        inputs=np.zeros(slots, np.int32),
    )


def _grown(setup: Setup, slots: int) -> Setup:
    """Make room for more slots."""
    longer = [np.concatenate([a, np.zeros((slots - len(a), *a.shape[1:]), a.dtype)]) for a in setup[1:]]
    return Setup(setup.subtriangles, *longer)
