"""The fixed-function pipe of the GPU itself, for comparison: vertices, setup, quads, depth, pixels."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.depth_format import DepthFormat
from tilestamp.simulator.stages.hardware import SUBPIXEL_BITS
from tilestamp.simulator.stages.hardware import hardware as draw
from tilestamp.simulator.stages.liu2010.freepipe_shade import pixel_colors
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors


def hardware(
    scene: Scene,
    matrix: NDArray[np.floating],
    width: int,
    height: int,
    simt: Simt,  # noqa: ARG001 - every pipeline is called alike; fixed function has no warps
    execute: Executor,
    *,
    cull_backfaces: bool = True,
    bits: int = SUBPIXEL_BITS,
    depth_format: DepthFormat = "fixed32",
) -> Frame:
    """The fixed-function rasterizer of a GPU: a pipe of units, each with a rate.

    Parameters
    ----------
    scene, matrix, width, height, simt, execute
        See ``tilestamp.simulator.pipelines``.
    cull_backfaces : bool
        Leave out what is clockwise on the screen.
    bits : int
        Sub-pixel bits, 4 to 8.
    depth_format : {"fixed16", "fixed24", "fixed32", "float32"}
        How depth is kept, in 2 or 4 bytes a pixel.
    """
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, matrix)
    frame, _, facts = execute(
        draw, positions, mesh.triangles, width, height,
        cull_backfaces=cull_backfaces, bits=bits, depth_format=depth_format,
    )  # fmt: skip
    image = pixel_colors(frame.ids, positions, mesh.triangles, vertex_colors(mesh, matrix))
    return Frame(image[::-1], frame.depth[::-1], execute.works, frame.ids[::-1], facts=dict(facts))
