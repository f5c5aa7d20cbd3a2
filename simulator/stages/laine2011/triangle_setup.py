"""Triangle setup: one thread an input triangle, culls, clips, snaps and writes sub-triangles (cudaraster, first stage).

Two published releases: "1.1" (Laine & Karras 2011) has a guard band in x and y and culls backfaces; "nvdiffrast"
(2022) clips whatever leaves the frustum and keeps backfaces unless told otherwise.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.laine2011.screen_vertices import screen_vertices
from tilestamp.simulator.stages.laine2011.subtriangle import View
from tilestamp.simulator.stages.laine2011.triangle_setup_count import TriangleSetupEvent
from tilestamp.simulator.stages.laine2011.triangle_setup_outcome import outcome_part
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import BLOCK, WARP, Setup, store_part, store_several
from tilestamp.simulator.stages.laine2011.triangle_setup_streams import setup_streams
from tilestamp.simulator.work import Work

Release = Literal["1.1", "nvdiffrast"]

SHARED_BYTES = 4608  # the clip polygons of 64 threads
SLACK = 4096  # sub-triangle slots beyond one for each triangle, at first
MAX_SUBTRIANGLES = 2**24
MAX_SIZE = 2048  # pixels along an axis: 16 bins of 16 tiles of 8 pixels
SUBTRIANGLE_BYTES = {"1.1": 81, "nvdiffrast": 33}  # count 1, header 16, data 64 or 16
_PART_BLOCKS = 64  # blocks that one call of the worker takes, at least


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


def check_mesh(positions: NDArray[Any], triangles: NDArray[Any], *, release: Release) -> tuple[int, int]:
    """Refuse arrays of other shapes and types, and indices that the release would not survive; the first and last."""
    if positions.ndim != 2 or positions.shape[1] != 4 or positions.dtype != np.float32:
        raise TilestampError(
            f"positions are {positions.dtype} {positions.shape}; float32 (V, 4) in clip space is needed"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype != np.int32:
        raise TilestampError(f"triangles are {triangles.dtype} {triangles.shape}; int32 (F, 3) is needed")
    if len(triangles) > MAX_SUBTRIANGLES:
        raise TilestampError(f"{len(triangles)} triangles: cudaraster takes at most {MAX_SUBTRIANGLES} a draw")
    first, last = (int(triangles.min()), int(triangles.max())) if len(triangles) else (0, -1)
    if release == "1.1" and (first < 0 or last >= len(positions)):
        bad = int(np.flatnonzero(((triangles < 0) | (triangles >= len(positions))).any(axis=1))[0])
        raise TilestampError(f"triangle {bad} has a vertex index out of range; the mesh has {len(positions)} vertices")
    return first, last


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
    used = check_mesh(positions, triangles, release=release)
    F = len(triangles)
    words = 16 if release == "1.1" else 4
    out = _new_setup(np.empty(F, np.uint8), 0, 0, words)
    table = np.zeros((-(-F // BLOCK) if counting else 0, len(TriangleSetupEvent)), np.int64)
    masks = np.empty((-(-F // WARP), 2), np.uint32)
    with np.errstate(all="ignore"):
        parts = parts_of(-(-F // BLOCK), _PART_BLOCKS)
        vertices = np.zeros((parts, 2), np.int64)
        given = (
            screen_vertices(positions, used, view),
            np.ascontiguousarray(positions).ravel(),
            np.ascontiguousarray(triangles).ravel(),
        )
        plain = used[0] >= 0 and used[1] < len(positions)
        single = for_parts(
            outcome_part, parts, *given, plain, view, simt, out, masks, vertices, table if counting else None
        )
        several = np.flatnonzero(out.subtriangles >= 2)
        counts = out.subtriangles[several].astype(np.int64)
        needed = F + int(counts.sum())
        capacity = F + SLACK if capacity is None else capacity
        if needed > capacity:
            several, counts = several[:0], counts[:0]
        records = np.cumsum([0, *single])
        out = _new_setup(out.subtriangles, F + int(counts.sum()), int(records[-1] + counts.sum()), words)
        for_parts(store_part, parts, records, *given, view, out, masks)
        out.misc[several] = F + np.cumsum(counts) - counts
        store_several(several, records[-1] - F, *given[1:], view, out)
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


def _new_setup(subtriangles: NDArray[np.uint8], slots: int, records: int, words: int) -> Setup:
    """Room for sub-triangles, their records of so many words."""
    return Setup(
        subtriangles=subtriangles,
        headers=np.empty((slots, 6), np.int16),
        misc=np.empty(slots, np.uint32),
        records=np.empty(slots, np.int32),
        planes=np.empty((records, words), np.uint32),
        inputs=np.empty(records, np.int32),
    )
