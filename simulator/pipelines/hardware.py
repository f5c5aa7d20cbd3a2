"""The fixed-function pipe of the GPU itself, for comparison: vertices, setup, quads, depth, pixels.

Modelled
--------
- Items that pass each unit: vertices fetched with reuse, primitives, culled ones, quads, depth tests, samples,
  pixels.
- Coverage at 8 sub-pixel bits, a guard band as wide as Direct3D 11's, four depth formats.
- Bytes to and from DRAM for vertices, colour and depth.

Not modelled
------------
- Tiles, compression of depth and colour, hierarchical depth tests: a unit is a rate in the machine file, and most
  are assumed.
- Programs of vertices and pixels: the units that run them are free.
- Several units that take turns at being the bottleneck within a frame: the slowest one over the frame sets the time.
"""

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.depth_format import DepthFormat
from tilestamp.simulator.stages.hardware import SUBPIXEL_BITS
from tilestamp.simulator.stages.hardware import hardware as draw
from tilestamp.simulator.stages.liu2010.freepipe_shade import pixel_colors
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors


class HardwareOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline hardware."""

    fixed_function: ClassVar[bool] = True
    cull_backfaces: bool = True
    """Leave out what is clockwise on the screen."""
    bits: Annotated[int, Meta(ge=4, le=8)] = SUBPIXEL_BITS
    """Sub-pixel bits."""
    depth_format: DepthFormat = "fixed32"
    """How depth is kept, in 2 or 4 bytes a pixel."""
    guard_band: bool = True
    """Clip in x and y only 32767 pixels out, so that what leaves the screen stays whole; false: at its borders."""


def hardware(
    scene: Scene,
    matrix: NDArray[np.floating],
    width: int,
    height: int,
    simt: Simt,  # noqa: ARG001 - every pipeline is called alike; fixed function has no warps
    options: HardwareOptions,
    execute: Executor,
) -> Frame:
    """The fixed-function rasterizer of a GPU: a pipe of units, each with a rate."""
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, matrix)
    frame, _, facts = execute(
        draw, positions, mesh.triangles, width, height,
        cull_backfaces=options.cull_backfaces, bits=options.bits, depth_format=options.depth_format,
        guard_band=options.guard_band,
    )  # fmt: skip
    image = pixel_colors(frame.ids, positions, mesh.triangles, vertex_colors(mesh, matrix))
    return Frame(image[::-1], frame.depth[::-1], execute.works, frame.ids[::-1], facts=dict(facts))
