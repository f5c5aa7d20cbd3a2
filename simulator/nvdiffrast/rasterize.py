"""``rasterize``: which triangle shows at each pixel, its barycentrics, and how they change from pixel to pixel."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.nvdiffrast.arrays import (
    Array,
    Faults,
    are_mended,
    as_array,
    as_resolution,
    as_triangles,
    need_axis,
)
from tilestamp.simulator.nvdiffrast.cost import priced
from tilestamp.simulator.nvdiffrast.draw import UNCOUNTED, Clip, draw
from tilestamp.simulator.run import Run
from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics
from tilestamp.simulator.stages.laine2011.pixel_shader import pixel_shader_work

Raster = tuple[NDArray[np.float32], NDArray[np.float32]]
Depths = list[NDArray[np.uint32]]
PEELERS: list[object] = []
"""The depth peeler at work, of those that keep the original's faults."""


class Batch:
    """The images of one call, checked.

    Parameters
    ----------
    pos, tri, resolution, ranges, grad_db, clip
        As ``rasterize`` takes them.
    """

    def __init__(
        self, pos: Array, tri: Array, resolution: Iterable[int], ranges: Array | None, grad_db: bool, clip: Clip
    ) -> None:
        if not isinstance(grad_db, bool):
            raise TilestampError(f"grad_db must be a bool, not {grad_db!r}")
        self.pos = as_array("pos", pos, np.float32, "[B, V, 4] (or [V, 4] with ranges)", 2, 3)
        need_axis("pos", self.pos, -1, 4, "[B, V, 4] (or [V, 4] with ranges)")
        self.tri = as_triangles(tri)
        self.height, self.width = as_resolution(resolution)
        self.ranges: NDArray[np.int32] | None = None
        if ranges is not None:
            self.ranges = as_array("ranges", ranges, np.int32, "[B, 2]", 2)
            need_axis("ranges", self.ranges, 1, 2, "[B, 2]")
        elif self.pos.ndim == 2:
            raise TilestampError("pos [V, 4] needs ranges, int32 [B, 2]: the triangles of each image")
        if clip not in {"2025", "2024"}:
            raise TilestampError(f"clip must be '2025' or '2024', not {clip!r}")
        self.clip = clip

    def __len__(self) -> int:
        return len(self.pos) if self.pos.ndim == 3 or self.ranges is None else len(self.ranges)

    def images(self) -> Iterator[tuple[NDArray[np.float32], NDArray[np.int32], int]]:
        """Positions and triangles of each image, and the number of its first triangle."""
        if self.pos.ndim == 3 or self.ranges is None:  # instanced: ranges are ignored, as in the original
            yield from ((positions, self.tri, 0) for positions in self.pos)
            return
        for start, count in self.ranges.tolist():
            first, last = min(max(start, 0), len(self.tri)), min(max(start + count, 0), len(self.tri))
            yield self.pos, self.tri[first:last], first

    def layer(
        self, behind: Depths | None = None, execute: Executor = UNCOUNTED, simt: Simt | None = None
    ) -> tuple[Raster, Depths]:
        """Draw all images, or the next layer of them; returns ``rasterize``'s arrays, and the depths."""
        simt = simt or Simt()
        shape = len(self), self.height, self.width, 4
        rast, rast_db, depths = np.zeros(shape, np.float32), np.zeros(shape, np.float32), []
        for i, (positions, triangles, first) in enumerate(self.images()):
            nearest = None if behind is None else behind[i]
            shown = draw(positions, triangles, self.height, self.width, self.clip, nearest, execute, simt)
            pixel_barycentrics(shown.ids, positions, triangles, rast[i], rast_db[i], first)
            if execute.counting:
                execute.works.append(pixel_shader_work(shown.ids, triangles, simt))
            depths.append(shown.depths)
        return (rast, rast_db), depths


@overload
def rasterize(
    pos: Array,
    tri: Array,
    resolution: Iterable[int],
    ranges: Array | None = None,
    grad_db: bool = True,
    *,
    clip: Clip = "2025",
    faults: Faults = "kept",
    cost: None = None,
) -> Raster: ...


@overload
def rasterize(
    pos: Array,
    tri: Array,
    resolution: Iterable[int],
    ranges: Array | None = None,
    grad_db: bool = True,
    *,
    clip: Clip = "2025",
    faults: Faults = "kept",
    cost: Machine | str | Path,
) -> tuple[NDArray[np.float32], NDArray[np.float32], Run]: ...


def rasterize(
    pos: Array,
    tri: Array,
    resolution: Iterable[int],
    ranges: Array | None = None,
    grad_db: bool = True,
    *,
    clip: Clip = "2025",
    faults: Faults = "kept",
    cost: Machine | str | Path | None = None,
) -> Raster | tuple[NDArray[np.float32], NDArray[np.float32], Run]:
    """Rasterize triangles as ``nvdiffrast.torch.rasterize`` with ``RasterizeCudaContext`` does.

    Parameters
    ----------
    pos : array, (B, V, 4), float32
        Clip positions of each image of the batch; (V, 4) with ``ranges``.
    tri : array, (F, 3), int32
        Vertex indices. A triangle with an index out of range is not drawn, as in the original.
    resolution : tuple of int
        Height and width in pixels. Above 2048 the picture is drawn in several viewports.
    ranges : array, (B, 2), int32, optional
        First triangle and number of triangles of each image, with ``pos`` (V, 4). Instanced mode ignores them.
    grad_db : bool
        As in the original: of the backward pass, which there is none of here. Derivatives are always returned.
    clip : {"2025", "2024"}
        The clip test of 0.3.4 and later, or that of 0.3.3.
    faults : {"kept", "mended"}
        The original ignores ``ranges`` beside ``pos`` (B, V, 4); mended, they are refused.
    cost : Machine, str or Path, optional
        A GPU on which the call is priced.

    Returns
    -------
    rast : ndarray, (B, H, W, 4), float32
        u, v, z/w and triangle index + 1; zeros where nothing was drawn; row 0 at y = -1. u and v weigh vertices 0 and
        1, perspective-correct. Of equal depths the later triangle shows.
    rast_db : ndarray, (B, H, W, 4), float32
        du/dX, du/dY, dv/dX, dv/dY, in units of pixels.
    run : Run
        With ``cost``: what the call would take there, by stage (``run.stages``, whose ``bound`` says why), and what
        moves it (``run.sensitivity()``). The images of a batch are priced one after another; the original draws them
        side by side, in less time.

    Raises
    ------
    TilestampError
        For other shapes, types or sizes.
    """
    if PEELERS:  # the original returns it, and so does this where a peeler was made to keep its faults
        return RuntimeError("depth peeling is at work: call rasterize_next_layer")  # type: ignore[return-value]
    batch = Batch(pos, tri, resolution, ranges, grad_db, clip)
    if are_mended(faults) and ranges is not None and batch.pos.ndim == 3:
        raise TilestampError("ranges go with pos [V, 4]; pos [B, V, 4] draws all triangles in each image")
    if cost is None:
        return batch.layer()[0]
    machine, execute = load_machine(cost), Executor(picture=False)
    raster, _ = batch.layer(None, execute, machine.simt)
    return *raster, priced(execute.works, machine, batch.width, batch.height)
