"""Splat: the tile rasterizer for 3D Gaussians, sorted by tile and depth (Kerbl et al. 2023).

Modelled
--------
- The forward pass of the published CUDA sources, operation by operation in float32 with its fused multiply-adds, and
  the exp of the GPU's special function unit: all arrays and the picture are those of an H200, to the bit.
- Lists by the published square of three sigmas, by a box around the alpha cut-off, or by its ellipse (``bound``).
- Two scales (``two_scale``): lists of macro tiles of 8x4 tiles, blended tile by tile in batches, as HiGS does.
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
from tilestamp.simulator.stages.kerbl2023.two_scale import blend_batches, by_macro_tile
from tilestamp.simulator.stages.kerbl2023.two_scale_batch import COLUMNS, LINES
from tilestamp.simulator.stages.kerbl2023.two_scale_join import blend_partials
from tilestamp.simulator.work import Work

WAITS = 1  # of the host: it reads the number of pairs to size its buffers
_E = BlendEvent


class SplatOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline splat."""

    splats: ClassVar[bool] = True
    persistent: ClassVar[bool] = True
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

    two_scale: bool = False
    """List and sort by macro tiles of 8x4 tiles, and blend by tiles: batches of 1024 Gaussians make masks of the tiles
    that each reaches, and partial results are blended at the end."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.two_scale and (self.tile not in (8, 16) or self.threads or self.gradients != "none"):
            raise TilestampError("two_scale: tiles of 8 or 16, a warp a tile: leave out threads and gradients")
        if self.two_scale and (self.order == "pixel" or self.mask):
            raise TilestampError("two_scale: blended in the order of the tile, without masks of pixels")
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

    @property
    def listed(self) -> tuple[int, int]:
        """Width and height in pixels of what has a list: a tile, or a macro tile."""
        width, height = self.sides
        return (COLUMNS * width, LINES * height) if self.two_scale else (width, height)

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
    tiles = tiles_of(width, height, *options.listed)
    projected = execute(project, splats, camera, tiles, simt).outputs
    if options.bound != "square":
        projected = execute(tight_count, projected, tiles, simt, bound=options.bound).outputs
    ends = execute(scan, projected.tiles, simt).outputs
    keys = keys_of(tiles.total, options.key // 8)
    pairs = execute(duplicate, projected, ends, tiles, simt, bound=options.bound, keys=keys).outputs
    pairs = execute(sort, pairs, keys.sorted_bits, simt).outputs
    starts = execute(ranges, pairs.keys, tiles.total, simt, depth_bits=keys.depth_bits).outputs
    colours = colours_seen(splats, camera)
    inputs = (starts, pairs.values, projected, colours)
    if options.two_scale:
        small = tiles_of(width, height, *options.sides)
        partials, works, _ = execute(blend_batches, *inputs, tiles, small, simt, bound=options.bound)
        pixels = execute(blend_partials, partials, tiles, small, simt).outputs
        table = by_macro_tile(partials, works)
    else:
        if options.order == "pixel":
            pixels, works, _ = execute(blend_resort, *inputs, splats, camera, tiles, simt, window=options.window)
        else:
            threads = options.threads or options.pixels
            pixels, works, _ = execute(blend, *inputs, tiles, simt, threads=threads, mask=options.mask)
        table = _evaluations(works, tiles)
    if options.gradients != "none" and works:
        done = (works[0], pixels, pairs.values, len(splats), tiles, simt)
        execute(gradients, *done, atomics=options.gradients)
    lists = np.diff(starts)
    return Frame(
        np.clip(pixels.colours * 255 + np.float32(0.5), 0, 255).astype(np.uint8),
        _depth(pixels, starts, pairs, projected, tiles),
        execute.works,
        maps=_maps(lists, table, pixels, tiles),
        facts={
            "tile": options.tile,
            "visible Gaussians": int(np.count_nonzero(projected.radii)),
            "list entries": len(pairs.keys),
            "longest list": int(lists.max()),
            "launches that the host waits for": WAITS,
        },
        tile=options.listed,
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


def _evaluations(works: tuple[Work, ...], tiles: Tiles) -> NDArray[np.int64]:
    """Evaluations and blends of each tile, (tiles, 2)."""
    if not works:
        return np.zeros((tiles.total, 2), np.int64)
    events = works[0].events
    return works[0].table[:, [events["EVALUATIONS"], events["BLENDED"]]]


def _maps(
    lists: NDArray[np.int64], table: NDArray[np.int64], pixels: Pixels, tiles: Tiles
) -> dict[str, NDArray[np.generic]]:
    """Heat maps: a cell a list, and a pixel of what its list reached; the table has evaluations and blends."""
    made, used = table.T
    efficiency = np.divide(used, made, out=np.zeros(len(made)), where=made > 0)
    shape = (tiles.rows, tiles.columns)
    maps = {"pairs": lists, "evaluations": made, "efficiency": efficiency}
    return {name: counts.reshape(shape) for name, counts in maps.items()} | {"reached": pixels.reached}
