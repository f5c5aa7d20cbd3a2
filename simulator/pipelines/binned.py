"""Zhang 2025: sort-middle by bins, tiles and quads; trilinear textures; API order or order-independent transparency.

Modelled
--------
- Clears, nine kernels before and after their optimizations, bins, tiles and quads, hierarchical and early depth
  tests.
- Textures in rows or tiles, trilinear filtering, transparency in API order or by depth.
- Derivatives without quads, where asked for (``derivatives``).
- What the original gets wrong where it is asked for: lost fragments, holes of a stepped depth, rows beyond whole
  blocks.

Not modelled
------------
- More than 2048 pixels on a side.
- The graph's parallel branches: ``zhang2025/graph`` prices them; a run's launches follow one another.
- Kernels before their optimization on 9.0: they have the instructions of 8.6.
"""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.clip_space import model_to_clip
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.texture import MAX_LEVELS, TILE, texture_chains
from tilestamp.simulator.scenes.textured_mesh import geometry, input_ids
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE as SCREEN_TILE
from tilestamp.simulator.stages.zhang2025.coarse_bin import CoarseRasterizerEvent
from tilestamp.simulator.stages.zhang2025.coarse_rasterizer import coarse_rasterizer, coarse_work
from tilestamp.simulator.stages.zhang2025.fine_rasterizer import fine_rasterizer
from tilestamp.simulator.stages.zhang2025.frame_clears import frame_clears
from tilestamp.simulator.stages.zhang2025.pixel_shader import OVERDRAW, Derivatives, Filter, pixel_shader
from tilestamp.simulator.stages.zhang2025.primitive_assembly import primitive_assembly
from tilestamp.simulator.stages.zhang2025.primitive_binning import primitive_binning
from tilestamp.simulator.stages.zhang2025.primitive_compaction import primitive_compaction
from tilestamp.simulator.stages.zhang2025.rop import KEPT, FragmentDepth, Order, rop
from tilestamp.simulator.stages.zhang2025.rop_block import RopEvent
from tilestamp.simulator.stages.zhang2025.streaming_to_frame_buffer import streaming_to_frame_buffer
from tilestamp.simulator.stages.zhang2025.triangle_setup import triangle_setup
from tilestamp.simulator.stages.zhang2025.vertex_fetch_and_shading import vertex_fetch_and_shading
from tilestamp.simulator.work import Work

REMARKS = {
    "holes": "{:,} pixels are holes: the stepped depth of all their fragments fails the last test",
    "fragments lost beyond the kept ones": (
        "{:,} fragments beyond those that a pixel can keep are lost; the original, which keeps 4, writes past its "
        "shared memory there and stops (illegal memory access on an H200)"
    ),
    "fragments beyond the stream's room": "{:,} fragments find no room in the original's stream",
}


class BinnedOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline binned."""

    maps: ClassVar[dict[str, str]] = {"tile queue": "triangles in a tile's queue"}
    textures: ClassVar[bool] = True
    order: Order = "api"
    """Blend in the order of the triangles with a depth test, or by depth without one (oit: order-independent
    transparency; then nothing is rejected early)."""
    texture_filter: Filter = "trilinear"
    """How textures are filtered."""
    texture_layout: Literal["tiled", "rows"] = "tiled"
    """How texels are stored."""
    texture_tile: Literal[2, 4, 8, 16] = TILE
    """Texels on a side of a storage tile."""
    texture_levels: Annotated[int, Meta(ge=0, le=MAX_LEVELS)] = 0
    """Levels of a texture for trilinear filtering; 0 for all. The original's current state: rows, 4 levels."""
    derivatives: Derivatives = "quads"
    """Derivatives of texture coordinates: differences in a quad of 2x2 pixels, or from the planes of the triangle; then
    pixels that it does not cover are not shaded."""
    cull_backfaces: bool = True
    """Cull triangles that face away."""
    fragments_a_pixel: Annotated[int, Meta(ge=0, le=65536)] = KEPT
    """How many a pixel can keep; 0 for all."""
    fragment_depth: FragmentDepth = "direct"
    """How the depth that goes to the last test is evaluated: as early z does; or stepped within a quad, as the original
    did, which leaves one-pixel holes; or less 1e-4, its cure."""
    opacity: Annotated[float, Meta(ge=0, le=1)] = 1.0
    """Multiplies every alpha."""
    optimized: bool = True
    """The kernels after the optimizations that the source lists, or before."""
    original_faults: bool = False
    """As the original, leave out the rows beyond whole blocks of 32 (the top 24 of 1080), and a frame's fragment 0."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """The coarse rasterizer takes the most registers and shared memory."""
        return [coarse_work(np.zeros((0, len(CoarseRasterizerEvent)), np.int64), unrolled=self.optimized)]


def binned(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: BinnedOptions, execute: Executor
) -> Frame:
    """Textured triangles through bins, tiles, quads and fragment lists, after a frame's clears (Zhang 2025).

    At most 2048 pixels on a side.
    """
    optimized = options.optimized
    mesh = geometry(scene)
    matrix = model_to_clip(scene.mesh, matrix)
    textures = scene.mesh.textures if scene.mesh else ()
    stored = options.texture_tile if options.texture_layout == "tiled" else 0
    chains = texture_chains(
        textures, tile=stored, mips=options.texture_filter == "trilinear", levels=options.texture_levels
    )
    opaque = options.order == "api"

    execute(frame_clears, len(mesh.triangles), width * height, simt)
    vertices = execute(vertex_fetch_and_shading, mesh, matrix, simt).outputs
    slots = execute(primitive_assembly, mesh, vertices, width, height, simt, culling=options.cull_backfaces).outputs
    primitives = execute(primitive_compaction, slots, len(mesh.triangles), simt).outputs
    data = execute(triangle_setup, primitives, simt, triangles=len(mesh.triangles)).outputs
    bins = execute(primitive_binning, data.boxes, width, height, simt, triangles=len(mesh.triangles)).outputs
    tiles = execute(
        coarse_rasterizer,
        data,
        bins,
        width,
        height,
        simt,
        hi_z=opaque,
        unrolled=optimized,
        exact_hi_z=options.original_faults,
    ).outputs
    fragments = execute(
        fine_rasterizer,
        data,
        tiles,
        width,
        height,
        simt,
        early_z=opaque,
        optimized=optimized,
        whole_blocks=options.original_faults,
    ).outputs
    stream = execute(
        pixel_shader, data, tiles, fragments, chains, mesh.texture_ids, simt,
        texture_filter=options.texture_filter, opacity=options.opacity, optimized=optimized,
        derivatives=options.derivatives,
    ).outputs  # fmt: skip
    pixels, (resolve,), _ = execute(
        rop, data, tiles, fragments, stream, simt, order=options.order, fragment_depth=options.fragment_depth,
        limit=options.fragments_a_pixel, optimized=optimized, zero_ends=options.original_faults,
    )  # fmt: skip
    image = execute(streaming_to_frame_buffer, pixels, simt, optimized=optimized).outputs

    in_stream = int(np.bitwise_count(stream.shaded).sum(dtype=np.int64))
    facts = {
        "primitives after culling": len(data.ids),
        "quads": len(stream.entries),
        "fragments beyond the stream's room": max(0, in_stream - OVERDRAW * width * height),
        "fragments lost beyond the kept ones": resolve.total(RopEvent.LOST),
        "holes": resolve.total(RopEvent.HOLES),
    }
    return Frame(
        image,
        pixels.depth[::-1],
        execute.works,
        triangle_ids=input_ids(mesh, pixels.winners)[::-1],
        maps={"tile queue": np.diff(tiles.starts).reshape(-1, tiles.columns)[::-1]},
        facts=facts,
        warnings=remarks(REMARKS, facts),
        tile=SCREEN_TILE,
        tiles_from_below=True,
    )
