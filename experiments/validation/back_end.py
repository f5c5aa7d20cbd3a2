"""The micropolygon back end as it was measured: bucketing and tile raster of one scene, at each tile size."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tilestamp.experiments.validation.shuffle import shuffled
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import TILE_SIZES, screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.work import Work

CAMERAS = "micropolygon_cameras.json"
SHUFFLED = "_shuffle"
PADDED = {  # words from one counter to the next, and whether a warp adds once for all its lanes at one
    "k_addr_pad1": (1, False),
    "k_addr_pad8": (8, False),
    "k_addr_pad32": (32, False),
    "k_addr_pad64": (64, False),
    "k_addr_pad1_warpagg": (1, True),
    "k_addr_pad64_warpagg": (64, True),
}
NO_BOX_TILE = 8  # the only tile size that was measured without box tests


@dataclass(frozen=True)
class Case:
    """One kernel of one scene."""

    tile: int
    spp: int
    kernel: str  # as the measurements call it
    work: Work


def cameras(folder: Path) -> dict[str, Any]:
    """Scenes of a folder of measurements, each with model, size, bound and matrix.

    Raises
    ------
    TilestampError
        No such file in the folder, or one that is not JSON.
    """
    try:
        table: dict[str, Any] = json.loads((folder / CAMERAS).read_text("utf-8"))
    except OSError as error:
        raise TilestampError(f"cannot read {folder / CAMERAS}: {error.strerror}") from error
    except json.JSONDecodeError as error:
        raise TilestampError(f"{folder / CAMERAS} is not JSON: {error}") from error
    return table


def grids_of(camera: dict[str, Any], simt: Simt, *, shuffle: bool) -> Grids:
    """Bound, split and dice the model of a camera, as the measured front end did; permuted if shuffled."""
    patches = load_scene(camera["model"]).patches
    if patches is None:
        raise TilestampError(f"{camera['model']} has no patches")
    view = (camera["model_to_clip"], camera["width"], camera["height"])
    subpatches, _, _ = bound_and_split(patches.points, *view, camera["bound_pixels"], simt, counting=False)
    grids, _, _ = dice(patches.points, subpatches, *view, simt, counting=False)
    if not shuffle:
        return grids
    order = shuffled(len(grids.boxes))
    return grids._replace(vertices=grids.vertices[order], boxes=grids.boxes[order])


def back_end(grids: Grids, camera: dict[str, Any], simt: Simt, *, padded: bool = False) -> Iterator[Case]:
    """Run the measured kernels at each tile size; with padded and aggregated counters only where asked for."""
    width, height = camera["width"], camera["height"]
    for tile in TILE_SIZES:
        tiles = screen_tiles(width, height, tile, camera["bound_pixels"])
        (count, idx), added, _ = bucket_count(grids.boxes, tiles, simt)
        start, _, _ = bucket_scan(count, simt, counting=False)
        lists, written, _ = bucket_write(grids.boxes, tiles, count, start, idx, simt)
        yield Case(tile, 0, "k_addr", added[1])
        for name, (padding, aggregate) in PADDED.items() if padded and tile >= camera["bound_pixels"] else ():
            (_, _), spread, _ = bucket_count(grids.boxes, tiles, simt, padding=padding, aggregate=aggregate)
            yield Case(tile, 0, name, spread[1])
        yield Case(tile, 0, "k_write", written[0])
        for spp in (1, 4):
            for box in (True, False) if tile == NO_BOX_TILE else (True,):
                drawn = tile_raster(
                    grids.vertices, count, start, lists, tiles, width, height, simt, spp=spp, box_tests=box
                ).works
                yield Case(tile, spp, "k_raster" if box else "k_raster_nobox", drawn[0])
