"""CudaRaster: triangles to pixels in four kernels, in input order (Laine & Karras 2011, section 3).

Triangle setup culls and prepares, bin raster queues triangles by 128x128 pixels, coarse raster by 8x8, and fine
raster draws each 8x8 tile in shared memory.

Modelled
--------
- All four kernels of both releases to the bit: queues, segments, input order, clipping, snapping, pictures,
  counters.
- Batches, samples (1 to 8), four modes, and attempts that fail because a queue is too short (``first_frame``).
- An alpha test, and its survivors compacted before they are shaded (``alpha_test``, ``compact``).
- A program in the ROP (``blend``), a user's function too; lists of fragments that are blended by depth (``lists``).
- What nvdiffrast's copy of the parameters to local memory costs (``copy_parameters``).

Not modelled
------------
- Vertex shading: vertices come in clip space; the transform is free.
- Which block draws which bin or batch: they take turns. No picture depends on it, only which streams are longest.
- Sizes above 2048 pixels; these, ranges, depth peeling and derivatives of nvdiffrast are in ``simulator.nvdiffrast``.
- Copies between host and GPU.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.pipelines._cudaraster_facts import (
    REMARKS,
    Counters,
    add_counters,
    fine_counters,
    first_room,
    frame_facts,
    setup_counters,
)
from tilestamp.simulator.pipelines._cudaraster_image import frame_image, tile_maps
from tilestamp.simulator.pipelines._cudaraster_rop import draw_by, reads_depth
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.laine2011 import bin_raster as bins
from tilestamp.simulator.stages.laine2011 import coarse_raster as tiles
from tilestamp.simulator.stages.laine2011.alpha_test import alpha_test
from tilestamp.simulator.stages.laine2011.blend_programs import BUILT_IN, find_program
from tilestamp.simulator.stages.laine2011.coarse_raster import TileQueues
from tilestamp.simulator.stages.laine2011.coverage import TILE, shown_sample
from tilestamp.simulator.stages.laine2011.fine_raster import MODES, Mode, fine_raster
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers
from tilestamp.simulator.stages.laine2011.parameter_copy import COPYING, with_parameter_copy
from tilestamp.simulator.stages.laine2011.triangle_setup import (
    MAX_SUBTRIANGLES,
    SLACK,
    Release,
    as_published,
    triangle_setup,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors
from tilestamp.simulator.work import Work


class CudarasterOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline cudaraster."""

    maps: ClassVar[dict[str, str]] = {
        "tile_triangles": "triangles in a tile's queue",
        "tile_fragments": "fragments of a tile",
        "tile_z_kills": "triangles of a tile that its depth rejects",
    }
    persistent: ClassVar[bool] = True
    votes: ClassVar[bool] = True
    release: Release = "1.1"
    """CudaRaster 1.1, or the copy in nvdiffrast."""
    msaa: Literal[1, 2, 4, 8] = 1
    """Samples a pixel (nvdiffrast: 1)."""
    mode: Mode = "depth"
    """Depth test and interpolation; no depth, interpolation, blending; depth without colour; neither depth nor
    interpolation (the published sweep). nvdiffrast has depth alone."""
    cull_backfaces: bool | None = None
    """Drop triangles that face away; none: as published, on in 1.1, off in nvdiffrast."""
    guard_band: bool | None = None
    """Leave triangles whole that leave the screen by less than 2048 pixels; none: on in 1.1, off in nvdiffrast, whose
    copies differ: some have it on. As in the original, a clipped triangle beside a whole one then leaves holes along
    their edge (experiment stability/guard_band)."""
    blend: str = "over"
    """Program of the ROP, mode blend: over, additive, max, multiply, nearest, k-buffer, stochastic, or MODULE:NAME of a
    Numba function of yours (``tilestamp.simulator.stages.laine2011.blend_programs``)."""
    layers: Annotated[int, Meta(ge=1, le=32)] = 4
    """Fragments that a k-buffer keeps of a pixel; samples of stochastic transparency."""
    lists: Literal["none", "linked", "round", "chunked", "fixed"] = "none"
    """Mode blend: keep all fragments, and blend them by depth in a kernel of its own. Nodes linked with an atomic each,
    one for a round of 32 or one for a chunk; or a fixed number of places a pixel."""
    room: Annotated[int, Meta(ge=1, le=1024)] = 32
    """Nodes of a chunk, or fixed places of a pixel."""
    alpha_test: Annotated[float, Meta(ge=0, le=1)] | None = None
    """Mode depth: discard fragments whose alpha is below; none: no test."""
    compact: bool = False
    """After an alpha test, gather what is left in whole warps before it is shaded."""
    batches: Annotated[int, Meta(ge=1, le=1024)] = 1
    """Draws that the triangles are divided among; the first clears."""
    copy_parameters: bool = False
    """As nvdiffrast was published: each thread of setup and bin raster copies its parameters to local memory."""
    first_frame: bool = False
    """Queues have their first size: a draw that overflows one is repeated, and what failed is priced too. Without it
    they have grown in a frame before, as where frames are timed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("cull_backfaces", "guard_band"):
            msgspec.structs.force_setattr(self, name, as_published(getattr(self, name), self.release))
        if self.release == "nvdiffrast" and (self.mode != "depth" or self.msaa != 1):
            raise TilestampError(f"release nvdiffrast has mode depth and msaa 1, not {self.mode} and {self.msaa}")
        if self.blend not in BUILT_IN:
            find_program(self.blend)
        if self.programmable and (self.mode != "blend" or self.msaa != 1 or self.batches != 1):
            raise TilestampError(
                f"blend {self.blend}, lists {self.lists}: mode blend, msaa 1 and batches 1 alone have them"
            )
        if self.lists != "none" and self.blend != BUILT_IN[0]:
            raise TilestampError(f"lists {self.lists}: they are blended over, not by {self.blend}")
        plain = self.release == "1.1" and self.mode == "depth" and self.msaa == self.batches == 1
        if self.alpha_test is not None and not plain:
            raise TilestampError("alpha_test: release 1.1 in mode depth, with msaa 1 and batches 1, alone has it")
        if self.copy_parameters and self.release != "nvdiffrast":
            raise TilestampError(f"copy_parameters: release {self.release} does not copy them; nvdiffrast does")

    @property
    def programmable(self) -> bool:
        """Whether the ROP runs a program, or keeps lists."""
        return self.blend != BUILT_IN[0] or self.lists != "none"


@dataclass
class _State:
    """What draws of one frame hand on: capacities, pixels and sums."""

    options: CudarasterOptions
    execute: Executor
    size: tuple[int, int]
    simt: Simt
    colors: NDArray[np.float32] | None
    capacity: dict[str, int] = field(default_factory=lambda: {"numSubtris": 0, "numBinSegs": 0, "numTileSegs": 0})
    needed: dict[str, int] = field(default_factory=lambda: {"numSubtris": 0, "numBinSegs": 0, "numTileSegs": 0})
    retries: int = 0
    facts: Mapping[str, Any] = field(default_factory=dict)  # of a ROP that is not the published one
    buffers: FrameBuffers | None = None
    counters: Counters = field(default_factory=dict)
    maps: dict[str, NDArray[Any]] = field(default_factory=dict)


def cudaraster(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: CudarasterOptions, execute: Executor
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
    options : CudarasterOptions
    execute : Executor

    Returns
    -------
    Frame
        Depth is the original's fixed point, uint32. With several samples, depth and triangle ids are those of the
        sample nearest to the pixel's centre. ``facts["retries"]``: draws that a first frame repeats.

    Raises
    ------
    TilestampError
        Where the scene or the size cannot be drawn.
    """
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, matrix)
    shaded = (
        options.programmable or options.alpha_test is not None or (options.mode != "depth-only" and execute.picture)
    )
    colors = vertex_colors(mesh, matrix) if shaded else None
    state = _State(options, execute, (width, height), simt, colors)
    for first, last in _batch_bounds(len(mesh.triangles), options.batches):
        _draw(state, positions, mesh.triangles[first:last], first)
    copied = COPYING if options.copy_parameters else ()
    works = [with_parameter_copy(work) if work.kernel in copied else work for work in execute.works]
    facts = frame_facts(state.counters, state.needed, options.release, state.retries) | dict(state.facts)
    if not execute.picture:
        return Frame.numbers(works, facts, remarks(REMARKS, facts))
    assert state.buffers is not None  # noqa: S101 - there is at least one batch
    shown = shown_sample(options.msaa)
    ids = state.buffers.ids[shown, :height, :width][::-1]
    image = frame_image(state.buffers, width, height, options.release, positions, mesh.triangles, colors)
    return Frame(
        image,
        state.buffers.depth[shown, :height, :width][::-1],
        works,
        ids,
        maps=state.maps,
        facts=facts,
        warnings=remarks(REMARKS, facts),
        tile=TILE,
        tiles_from_below=True,
    )


def _draw(state: _State, positions: NDArray[np.float32], triangles: NDArray[np.int32], first: int) -> None:
    """One draw: the four stages; in a first frame, again from the start with larger buffers where one was too small.

    A stage that overflows is executed to its end all the same; the kernels behind it return at once.
    """
    options, execute, (width, height) = state.options, state.execute, state.size
    depth, _, _, interpolate = MODES[options.mode]
    planes = depth or (options.programmable and reads_depth(options.blend, options.lists))
    shape: dict[str, Any] = {"width": width, "height": height, "simt": state.simt, "release": options.release}
    _initial_capacity(state, len(triangles))
    clear = state.buffers is None
    while True:
        setup, prepared, facts = execute(
            triangle_setup, positions, triangles, **shape, samples=options.msaa, depth=planes, interpolate=interpolate,
            cull_backfaces=options.cull_backfaces, guard_band=options.guard_band,
            variant=options.mode if planes == depth else "depth",
            capacity=state.capacity["numSubtris"] if options.first_frame else MAX_SUBTRIANGLES,
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
    buffers, drawn = _draw_tiles(state, setup, lists)
    state.buffers = buffers
    if execute.counting:
        visible = int(np.count_nonzero(setup.subtriangles))
        counters = setup_counters(prepared[0], drawn[0], visible, len(triangles)) | bin_facts["counters"]
        counters |= tile_facts["counters"] | fine_counters(drawn[0], depth=depth, msaa=options.msaa)
        state.counters = add_counters(state.counters, counters)
    tile_maps(state.maps, lists, drawn[0] if execute.counting else None)


def _draw_tiles(state: _State, setup: Setup, queues: TileQueues) -> tuple[FrameBuffers, tuple[Work, ...]]:
    """Fine raster, with its own ROP or another."""
    options, execute, (width, height) = state.options, state.execute, state.size
    if options.programmable:
        assert state.colors is not None  # noqa: S101 - made where there is a program
        buffers, works, state.facts = draw_by(
            execute, setup, queues, state.size, state.simt, state.colors,
            blend=options.blend, layers=options.layers, lists=options.lists, room=options.room,
        )  # fmt: skip
        return buffers, works
    if options.alpha_test is not None:
        assert state.colors is not None  # noqa: S101 - made where there is an alpha test
        return execute(
            alpha_test, setup, queues.starts, queues.entries, queues.active, width, height, state.simt,
            reference=options.alpha_test, compact=options.compact, colors=state.colors,
        )[:2]  # fmt: skip
    return execute(
        fine_raster, setup, queues.starts, queues.entries, queues.active, width, height, state.simt,
        release=options.release, samples=options.msaa, mode=options.mode, colors=state.colors, buffers=state.buffers,
    )[:2]  # fmt: skip


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
    return state.options.first_frame


def _batch_bounds(triangles: int, batches: int) -> list[tuple[int, int]]:
    """First and last triangle of each draw."""
    return [(triangles * i // batches, triangles * (i + 1) // batches) for i in range(batches)]
