"""FreePipe: one kernel, one thread a triangle, atomics on a frame buffer in DRAM (Liu et al. 2010).

Modelled
--------
- One thread a triangle with its box, rows and steps; lanes that wait for the longest of their warp.
- Atomics with their conflicts, in one 64-bit or two 32-bit words; which fragment wins where depths are equal.
- What a look at the pixel before the atomic saves (``early``).

Not modelled
------------
- With ``early``: how old the values are that a warp reads. Warps run one after another here; a GPU's thousands at once
  read older ones, and leave out fewer atomics.
- Vertex and fragment programs of the original system: a fragment is a depth and a payload.
- Order-independent blending by several kept layers.
"""

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.camera import Matrix
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.liu2010.freepipe import BLOCK, Packing, freepipe_work
from tilestamp.simulator.stages.liu2010.freepipe import freepipe as draw
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_shade import pixel_colors
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors
from tilestamp.simulator.work import Work

REMARKS = {
    "tied_pixels": "{:,} pixels have several triangles at the nearest depth: which one shows depends on the packing",
    "mixed_pixels": "{:,} pixels mix the halves of two triangles' colours",
}


class FreepipeOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline freepipe."""

    maps: ClassVar[dict[str, str]] = {
        "tied_pixels": "pixels where another fragment has the same packed depth",
        "mixed_pixels": "pixels whose colour is made of two fragments' halves",
    }
    packing: Packing = "64"
    """One 64-bit atomicMin of depth and triangle, or the original's two 32-bit ones of depth and half a colour (then a
    triangle has one colour, the mean of its corners)."""
    early: bool = False
    """Read the pixel before the atomic (packing 64)."""
    block: Annotated[int, Meta(ge=32, le=1024, multiple_of=32)] = BLOCK
    """Threads in a block."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """One kernel, of ``block`` threads."""
        return [freepipe_work(np.zeros((0, len(FreePipeEvent)), np.int64), self.block, self.early)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.early and self.packing == "32":
            raise TilestampError("early: only packing 64 can be read before its atomic, not 32")


def freepipe(
    scene: Scene, matrix: Matrix, width: int, height: int, simt: Simt, options: FreepipeOptions, execute: Executor
) -> Frame:
    """FreePipe: one thread a triangle, atomics on the frame buffer (Liu et al. 2010).

    Parameters
    ----------
    scene, matrix, width, height, simt, options, execute
        See ``tilestamp.simulator.pipelines``.

    Returns
    -------
    Frame
        ``facts`` say where the picture depends on something else than depth: ``tied_pixels``, ``mixed_pixels``.
    """
    mesh = triangle_mesh(scene)
    positions = clip_positions(mesh, matrix)
    colors = vertex_colors(mesh, matrix)
    flat = _flat_colors(colors, mesh.triangles) if options.packing == "32" else None
    frame, _, facts = execute(
        draw, positions, mesh.triangles, width, height, simt,
        packing=options.packing, early=options.early, block=options.block, colors=flat,
    )  # fmt: skip
    if frame.colors is None:
        image = pixel_colors(frame.ids, positions, mesh.triangles, colors)
    else:
        channels = np.stack([frame.colors >> np.uint32(8 * c) for c in (2, 1, 0)], axis=-1) & np.uint32(255)
        image = (channels * (frame.ids >= 0)[..., None]).astype(np.uint8)
    maps = {"tied_pixels": frame.tied[::-1], "mixed_pixels": frame.mixed[::-1]}
    said = remarks(REMARKS, facts)
    return Frame(image[::-1], frame.depth[::-1], execute.works, frame.ids[::-1], maps, dict(facts), said)


def _flat_colors(colors: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.uint32]:
    """Mean colour of each triangle's corners, 24 bits, red on top."""
    safe = np.clip(triangles, 0, len(colors) - 1)  # the stage refuses what is out of range
    mean = colors[safe, :3].mean(axis=1)
    byte = np.clip(np.nan_to_num(mean) * 255 + 0.5, 0, 255).astype(np.uint32)
    packed: NDArray[np.uint32] = byte[:, 0] << np.uint32(16) | byte[:, 1] << np.uint32(8) | byte[:, 2]
    return packed
