"""CudaRaster: triangles to pixels in four kernels, in input order (Laine & Karras 2011, section 3).

Triangle setup culls and prepares, bin raster queues triangles by 128x128 pixels, coarse raster by 8x8, and fine
raster draws each 8x8 tile in shared memory.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._cudaraster_facts import (
    Counters,
    add_counters,
    fine_counters,
    first_room,
    frame_facts,
    setup_counters,
)
from tilestamp.simulator.pipelines._cudaraster_image import frame_image, tile_maps
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.laine2011 import bin_raster as bins
from tilestamp.simulator.stages.laine2011 import coarse_raster as tiles
from tilestamp.simulator.stages.laine2011.coverage import TILE, shown_sample
from tilestamp.simulator.stages.laine2011.fine_raster import MODES, FrameBuffers, Mode, fine_raster
from tilestamp.simulator.stages.laine2011.parameter_copy import COPYING, with_parameter_copy
from tilestamp.simulator.stages.laine2011.triangle_setup import MAX_SUBTRIANGLES, SLACK, Release, triangle_setup
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors

MAX_BATCHES = 1024


@dataclass
class _State:
    """What draws of one frame hand on: capacities, pixels and sums."""

    execute: Executor
    options: dict[str, Any]
    size: tuple[int, int]
    simt: Simt
    colors: NDArray[np.float32] | None
    first_frame: bool
    whole: bool  # later draws need the pixels
    capacity: dict[str, int] = field(default_factory=lambda: {"numSubtris": 0, "numBinSegs": 0, "numTileSegs": 0})
    needed: dict[str, int] = field(default_factory=lambda: {"numSubtris": 0, "numBinSegs": 0, "numTileSegs": 0})
    retries: int = 0
    buffers: FrameBuffers | None = None
    counters: Counters = field(default_factory=dict)
    maps: dict[str, NDArray[Any]] = field(default_factory=dict)


def cudaraster(
    scene: Scene,
    matrix: NDArray[np.floating],
    width: int,
    height: int,
    simt: Simt,
    execute: Executor,
    *,
    release: Release = "1.1",
    msaa: int = 1,
    mode: Mode = "depth",
    cull_backfaces: bool | None = None,
    guard_band: bool | None = None,
    batches: int = 1,
    copy_parameters: bool = False,
    first_frame: bool = False,
) -> Frame:
    """CudaRaster: setup, bins, tiles, pixels, in input order (Laine & Karras 2011).

    Parameters
    ----------
    scene : Scene
        With a mesh; one in clip space goes straight to triangle setup.
    matrix : ndarray, (4, 4)
        Model to clip space, row-major, column vectors; applied in float32.
    width, height : int
        Pixels, at most 2048.
    simt : Simt
        The machine's shape.
    execute : Executor
        Several batches share their pixels: then all units run.
    release : {"1.1", "nvdiffrast"}
    msaa : int
        1, 2, 4 or 8 samples a pixel (nvdiffrast: 1).
    mode : {"depth", "blend", "depth-only", "color"}
        Depth test and interpolation; no depth, interpolation, blending; depth without colour; neither depth nor
        interpolation (the published sweep).
    cull_backfaces : bool or None
        None: as published, on in 1.1, off in nvdiffrast.
    guard_band : bool or None
        Leave triangles whole that leave the screen by less than 2048 pixels; None: on in 1.1, off in nvdiffrast, whose
        copies differ: some have it on.
    batches : int
        Draws that the triangles are divided among; the first clears.
    copy_parameters : bool
        As nvdiffrast was published: each thread of setup and bin raster copies its parameters to local memory.
    first_frame : bool
        Queues have their first size: a draw that overflows one is repeated, and what failed is priced too. Without it
        they have grown in a frame before, as where frames are timed; ``facts["retries"]`` says how often.

    Returns
    -------
    Frame
        Depth is the original's fixed point, uint32. With several samples, depth and triangle ids are those of the
        sample nearest to the pixel's centre.

    Raises
    ------
    TilestampError
        Where the scene or an option cannot be drawn.
    """
    _check(release, mode, batches)
    if copy_parameters and release != "nvdiffrast":
        raise TilestampError(f"copy_parameters: release {release} does not copy them; nvdiffrast does")
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, matrix)
    options: dict[str, Any] = {"release": release, "samples": msaa, "mode": mode}
    options |= {"cull_backfaces": cull_backfaces, "guard_band": guard_band}
    colors = None if mode == "depth-only" or not execute.picture else vertex_colors(mesh, matrix)
    state = _State(execute, options, (width, height), simt, colors, first_frame, whole=batches > 1)
    for first, last in _batch_bounds(len(mesh.triangles), batches):
        _draw(state, positions, mesh.triangles[first:last], first)
    works = [with_parameter_copy(w) if copy_parameters and w.kernel in COPYING else w for w in execute.works]
    facts = frame_facts(state.counters, state.needed, release, state.retries)
    if not execute.picture:
        return Frame.numbers(works, facts)
    assert state.buffers is not None  # noqa: S101 - there is at least one batch
    shown = shown_sample(msaa)
    ids = state.buffers.ids[shown, :height, :width][::-1]
    image = frame_image(state.buffers, width, height, release, positions, mesh.triangles, colors)
    return Frame(
        image,
        state.buffers.depth[shown, :height, :width][::-1],
        works,
        ids,
        maps=state.maps,
        facts=facts,
        tile=TILE,
        tiles_from_below=True,
    )


def _draw(state: _State, positions: NDArray[np.float32], triangles: NDArray[np.int32], first: int) -> None:
    """One draw: the four stages; in a first frame, again from the start with larger buffers where one was too small.

    A stage that overflows is executed to its end all the same; the kernels behind it return at once.
    """
    execute, (width, height) = state.execute, state.size
    release, samples, mode = state.options["release"], state.options["samples"], state.options["mode"]
    depth, _, _, interpolate = MODES[mode]
    shape: dict[str, Any] = {"width": width, "height": height, "simt": state.simt, "release": release}
    _initial_capacity(state, len(triangles))
    clear = state.buffers is None
    while True:
        setup, prepared, facts = execute(
            triangle_setup, positions, triangles, **shape, samples=samples, depth=depth, interpolate=interpolate,
            cull_backfaces=state.options["cull_backfaces"], guard_band=state.options["guard_band"], variant=mode,
            capacity=state.capacity["numSubtris"] if state.first_frame else MAX_SUBTRIANGLES,
        )  # fmt: skip
        if _grow(state, "numSubtris", facts["numSubtris"], SLACK):
            continue
        queues, _, bin_facts = execute(bins.bin_raster, setup, **shape)
        if _grow(state, "numBinSegs", bin_facts["num_bin_segments"], 256):
            continue
        lists, _, tile_facts = execute(tiles.coarse_raster, queues, setup, deferred_clear=clear, **shape)
        if not _grow(state, "numTileSegs", tile_facts["num_tile_segments"], SLACK):
            break
    setup = setup._replace(inputs=setup.inputs + np.int32(first)) if first else setup
    state.buffers, drawn, _ = (execute if state.whole else execute.last)(
        fine_raster, setup, lists.starts, lists.entries, lists.active, **shape, samples=samples, mode=mode,
        colors=state.colors, buffers=state.buffers,
    )  # fmt: skip
    if execute.counting:
        visible = int(np.count_nonzero(setup.subtriangles))
        counters = setup_counters(prepared[0], drawn[0], visible, len(triangles)) | bin_facts["counters"]
        counters |= tile_facts["counters"] | fine_counters(drawn[0], depth=depth, msaa=samples)
        state.counters = add_counters(state.counters, counters)
    tile_maps(state.maps, lists, drawn[0] if execute.counting else None)


def _initial_capacity(state: _State, triangles: int) -> None:
    """Room for a draw, as the original makes it: from the number of triangles, and never less than before."""
    first = first_room(triangles, *state.size)
    state.capacity = {name: max(room, first[name]) for name, room in state.capacity.items()}


def _grow(state: _State, name: str, needed: int, slack: int) -> bool:
    """Note what a draw needed, and make more room where it did not fit; True where it has to be repeated now."""
    state.needed[name] = max(state.needed[name], needed)
    if needed <= state.capacity[name]:
        return False
    state.capacity[name] = needed + slack
    state.retries += 1
    return state.first_frame


def _batch_bounds(triangles: int, batches: int) -> list[tuple[int, int]]:
    """First and last triangle of each draw."""
    return [(triangles * i // batches, triangles * (i + 1) // batches) for i in range(batches)]


def _check(release: str, mode: str, batches: int) -> None:
    if mode not in MODES:
        raise TilestampError(f"mode is {mode!r}; there is {', '.join(MODES)}")
    if release == "nvdiffrast" and mode != "depth":
        raise TilestampError(f"mode is {mode!r}; release nvdiffrast has only 'depth'")
    if not 1 <= batches <= MAX_BATCHES:
        raise TilestampError(f"{batches} batches: 1 to {MAX_BATCHES} can be drawn")
