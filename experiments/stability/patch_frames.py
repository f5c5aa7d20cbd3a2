"""What the rows about patches share: patches by formula, a frame stage by stage, and what works cost."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.models.remembered import remembered
from tilestamp.models.simt import Simt
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import MAX_DEPTH, SubPatches, bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.work import Work

MACHINE = "gtx280"  # the paper's


class Split(NamedTuple):
    """The front end of a frame: sub-patches diced into grids."""

    subpatches: SubPatches
    grids: Grids
    works: tuple[Work, ...]

    @property
    def given_up(self) -> int:
        """Sub-patches dropped at the depth limit."""
        return int(self.subpatches.passes[:, 4].sum())


class Drawn(NamedTuple):
    """The back end of a frame."""

    image: NDArray[np.uint8]  # (H, W, 3)
    hits: NDArray[np.int32]  # (H, W) quads that cover each sample
    works: tuple[Work, ...]


def split(
    points: NDArray[np.float32],
    matrix: ArrayLike,
    width: int,
    height: int,
    *,
    bound: float = 4.0,
    near: float = 0.0,
    min_depth: int = 0,
    max_depth: int = MAX_DEPTH,
    simt: Simt | None = None,
) -> Split:
    """Bound and split, and dice."""
    simt = simt or simt_of(MACHINE)
    subpatches, works, _ = bound_and_split(
        points, matrix, width, height, bound, simt, near=near, min_depth=min_depth, max_depth=max_depth
    )
    grids, diced, _ = dice(points, subpatches, matrix, width, height, simt)
    return Split(subpatches, grids, works + diced)


def draw(
    grids: Grids, width: int, height: int, *, tile: int = 8, bound: float = 4.0, simt: Simt | None = None
) -> Drawn:
    """Bucketing and tile raster; ``bound`` decides how many tiles a grid may touch."""
    simt = simt or simt_of(MACHINE)
    tiles = screen_tiles(width, height, tile, bound)
    count, start, lists, works = bucket(grids.boxes, tiles, simt)
    (image, _, hits), drawn, _ = tile_raster(grids.vertices, count, start, lists, tiles, width, height, simt)
    assert hits is not None  # noqa: S101 - it is counted
    return Drawn(image, hits, works + drawn)


def bucket(
    boxes: NDArray[np.float32], tiles: Tiles, simt: Simt
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32], tuple[Work, ...]]:
    """Count, scan and write: COUNT, START, LISTS and the works."""
    (count, idx), counted, _ = bucket_count(boxes, tiles, simt)
    start, scanned, _ = bucket_scan(count, simt)
    lists, written, _ = bucket_write(boxes, tiles, count, start, idx, simt)
    return count, start, lists, counted + scanned + written


def milliseconds(works: Sequence[Work], machine: str = MACHINE, pipeline: str = "micropolygon") -> float:
    """Modelled time of launches one after another."""
    described = load_machine(machine)
    mix = load_mix(pipeline, described.compute_capability)
    timings = price([mix.launch(work, described.sm.warp_size) for work in works], described)
    return float(sum(timing.milliseconds for timing in timings))


def flat_patch(corners: ArrayLike) -> NDArray[np.float32]:
    """A bilinear patch, (1, 16, 4), of corners (2, 2, 3): the first axis is v, the second u."""
    c = np.asarray(corners, np.float64)
    t = np.arange(4) / 3
    along = c[:, :1] + t[None, :, None] * (c[:, 1:] - c[:, :1])
    points = along[:1] + t[:, None, None] * (along[1:] - along[:1])
    return np.concatenate([points.reshape(1, 16, 3), np.ones((1, 16, 1))], axis=2).astype(np.float32)


@remembered
def simt_of(machine: str) -> Simt:
    """Give the SIMT shape of a machine."""
    return load_machine(machine).simt
