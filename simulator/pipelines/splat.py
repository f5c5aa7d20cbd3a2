"""Splat: the tile rasterizer for 3D Gaussians, sorted by tile and depth (Kerbl et al. 2023).

Modelled
--------
- The forward pass of the published CUDA sources, operation by operation in float32 with its fused multiply-adds, and
  the exp of the GPU's special function unit: all arrays and the picture are those of an H200, to the bit.
- Lists by the published square of three sigmas, by a box around the alpha cut-off, or by its ellipse (``bound``).
- A bit mask of pixels that are not done, by which a warp skips entries (``mask``).
- Order at each pixel by a sorted window of registers, the simplest mode of StopThePop (``order``).
- The blending loop of the backward pass, counted (``gradients``): nine atomics a pixel and Gaussian, or a warp.
- Every kernel's launch; in the blending loop trips, steps that blend, rounds, and the warp that its block waits for.

Not modelled
------------
- The exp of other GPUs, where their special function unit is another one: that of an H200 is used for all.
- The time in which the host reads the number of pairs, as the fact ``launches that the host waits for``.
"""

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.kerbl2023.blend import blend, blend_work
from tilestamp.simulator.stages.kerbl2023.blend_pixels import Pixels
from tilestamp.simulator.stages.kerbl2023.blend_resort import blend_resort, resort_work
from tilestamp.simulator.stages.kerbl2023.duplicate import Pairs, duplicate, keys_of
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent, ResortEvent
from tilestamp.simulator.stages.kerbl2023.gradients import gradients
from tilestamp.simulator.stages.kerbl2023.harmonics import colours_seen
from tilestamp.simulator.stages.kerbl2023.project import Projected, project
from tilestamp.simulator.stages.kerbl2023.ranges import ranges
from tilestamp.simulator.stages.kerbl2023.scan import scan
from tilestamp.simulator.stages.kerbl2023.sort import pass_work, sort
from tilestamp.simulator.stages.kerbl2023.tight_count import tight_count
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles, tiles_of
from tilestamp.simulator.work import Work

WAITS = 1  # of the host: it reads the number of pairs to size its buffers
_E = BlendEvent


class SplatOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline splat."""

    splats: ClassVar[bool] = True
    maps: ClassVar[dict[str, str]] = {
        "pairs": "Gaussians in the list of a tile",
        "evaluations": "Gaussians evaluated at a pixel of a tile",
        "efficiency": "share of the evaluations of a tile that were blended",
        "reached": "entries of the list up to the last that a pixel blended",
    }
    tile: Literal[4, 8, 16, 32, "16x8"] = 16
    """Pixels on a side of a tile, or its width and height."""
    bound: Literal["square", "box", "ellipse"] = "square"
    """Which tiles list a Gaussian: those of the published square of three sigmas, of the box around its alpha cut-off,
    or those that the ellipse of that cut-off touches."""
    threads: Literal[32, 64, 128, 256, 512, 1024] | None = None
    """Threads of a block of the blending loop, fewer than a tile has pixels: each then has several; by default one."""

    mask: bool = False
    """Keep a bit mask of the pixels that are not done in each warp of the blending loop, and skip entries whose box
    has none of them."""

    key: Literal[64, 32] = 64
    """Bits of a key. Of 32 the tile leaves some for the depth, the highest: less is sorted, in fewer passes, and what
    lies close together keeps the order of the file."""

    order: Literal["tile", "pixel"] = "tile"
    """Blend a tile's list in the order of the centres, or at each pixel by the depth at which a Gaussian is densest
    along its ray: by a window that a thread keeps sorted, which is exact where no pixel needs a longer one."""

    window: Literal[4, 8, 16, 24] = 16
    """Gaussians of that window."""

    gradients: Literal["none", "lanes", "reduced"] = "none"
    """Count the blending loop of the backward pass, too: its atomics by each lane, or added up in each warp before."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gradients != "none" and self.threads not in (None, self.pixels):
            raise TilestampError("gradients: the backward pass has a thread a pixel: leave out threads")
        if self.order == "pixel" and (self.threads not in (None, self.pixels) or self.gradients != "none"):
            raise TilestampError("order: a pixel sorts with a thread of its own, and has no backward pass")
        if self.mask and (self.threads not in (None, self.pixels) or self.order == "pixel"):
            raise TilestampError("mask: of pixels that have a thread each and are blended in the order of the tile")
        if self.threads is not None and self.threads > self.pixels:
            raise TilestampError(f"threads: a tile of {self.tile} has {self.pixels} pixels, fewer than {self.threads}")

    @property
    def sides(self) -> tuple[int, int]:
        """Width and height of a tile in pixels."""
        if isinstance(self.tile, int):
            return self.tile, self.tile
        width, height = self.tile.split("x")
        return int(width), int(height)

    @property
    def pixels(self) -> int:
        """Of a tile."""
        return self.sides[0] * self.sides[1]

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """A pass of the sort; the blending loop has a thread for each pixel of a tile, or fewer."""
        tiles, none = tiles_of(*self.sides, *self.sides), np.zeros((0, len(_E)), np.int64)
        if self.order == "pixel":
            return [pass_work(none), resort_work(np.zeros((0, len(ResortEvent)), np.int64), tiles, self.window)]
        return [pass_work(none), blend_work(none, tiles, self.threads or self.pixels, mask=self.mask)]


def splat(
    scene: Scene, camera: Pinhole, width: int, height: int, simt: Simt, options: SplatOptions, execute: Executor
) -> Frame:
    """Gaussian splats by tile lists sorted by depth, a thread a pixel (Kerbl et al. 2023).

    Parameters
    ----------
    scene, width, height, simt, options, execute
        See ``tilestamp.simulator.pipelines``.
    camera : Pinhole

    Returns
    -------
    Frame
        ``buffers`` has what the kernels hand on: radii, tiles, depths, positions, conics, keys, listed (Gaussians, tile
        by tile from near to far), starts (of each tile in it), colours, transmittance, reached.
    """
    splats = scene.splats
    if splats is None:
        raise TilestampError(f"the scene {scene.name} has no splats, and splat draws nothing else")
    tiles = tiles_of(width, height, *options.sides)
    projected = execute(project, splats, camera, tiles, simt).outputs
    if options.bound != "square":
        projected = execute(tight_count, projected, tiles, simt, bound=options.bound).outputs
    ends = execute(scan, projected.tiles, simt).outputs
    keys = keys_of(tiles.total, options.key // 8)
    pairs = execute(duplicate, projected, ends, tiles, simt, bound=options.bound, keys=keys).outputs
    pairs = execute(sort, pairs, keys.sorted_bits, simt).outputs
    starts = execute(ranges, pairs.keys, tiles.total, simt, depth_bits=keys.depth_bits).outputs
    colours = colours_seen(splats, camera)
    threads = options.threads or options.pixels
    listed = (starts, pairs.values, projected, colours)
    if options.order == "pixel":
        pixels, works, _ = execute(blend_resort, *listed, splats, camera, tiles, simt, window=options.window)
    else:
        pixels, works, _ = execute(blend, *listed, tiles, simt, threads=threads, mask=options.mask)
    if options.gradients != "none" and works:
        inputs = (works[0], pixels, pairs.values, len(splats), tiles, simt)
        execute(gradients, *inputs, atomics=options.gradients)
    lists = np.diff(starts)
    return Frame(
        np.clip(pixels.colours * 255 + np.float32(0.5), 0, 255).astype(np.uint8),
        _depth(pixels, starts, pairs, projected, tiles),
        execute.works,
        maps=_maps(lists, works, pixels, tiles),
        facts={
            "tile": options.tile,
            "visible Gaussians": int(np.count_nonzero(projected.radii)),
            "list entries": len(pairs.keys),
            "longest list": int(lists.max()),
            "launches that the host waits for": WAITS,
        },
        tile=options.sides,
        buffers={**projected._asdict(), "keys": pairs.keys, "listed": pairs.values, "starts": starts}
        | pixels._asdict(),
    )


def _depth(
    pixels: Pixels, starts: NDArray[np.int64], pairs: Pairs, projected: Projected, tiles: Tiles
) -> NDArray[np.float32]:
    """Depth of the last Gaussian that a pixel blends; 1 where there is none."""
    y, x = np.nonzero(pixels.reached)
    depth = np.ones(pixels.reached.shape, np.float32)
    tile = y // tiles.tile_y * tiles.columns + x // tiles.tile_x
    depth[y, x] = projected.depths[pairs.values[starts[tile] + pixels.reached[y, x] - 1]]
    return depth


def _maps(
    lists: NDArray[np.int64], works: tuple[Work, ...], pixels: Pixels, tiles: Tiles
) -> dict[str, NDArray[np.generic]]:
    """Heat maps: a cell a tile, and a pixel of what its list reached."""
    made, used = (
        works[0].table[:, works[0].events[name]] if works else np.zeros(tiles.total, np.int64)
        for name in ("EVALUATIONS", "BLENDED")
    )  # fmt: skip
    efficiency = np.divide(used, made, out=np.zeros(len(made)), where=made > 0)
    shape = (tiles.rows, tiles.columns)
    maps = {"pairs": lists, "evaluations": made, "efficiency": efficiency}
    return {name: counts.reshape(shape) for name, counts in maps.items()} | {"reached": pixels.reached}
