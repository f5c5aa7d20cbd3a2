"""CudaRaster where numbers are wanted within an error: part of the tiles are drawn, and no picture."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.simt import Simt
from simulator.sampler import Sampler
from simulator.stages.laine2011 import bin_raster as bins
from simulator.stages.laine2011 import coarse_raster as tiles
from simulator.stages.laine2011.fine_raster import MODES, WARP_LINES, WARPS, count_starts, fine_raster, fine_streams
from simulator.stages.laine2011.sampled_tiles import tile_areas
from simulator.stages.laine2011.triangle_setup import triangle_setup
from simulator.work import Work


def sampled_draw(
    sample: Sampler,
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    options: dict[str, Any],
) -> list[Work]:
    """One draw: the first three stages, and fine raster on part of the tiles by the length of their lists.

    Parameters
    ----------
    sample : Sampler
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Pixels.
    simt : Simt
    options : dict
        ``release``, ``samples``, ``mode`` and ``cull_backfaces``.
    """
    release, samples, mode = options["release"], options["samples"], options["mode"]
    depth, _, _, interpolate = MODES[mode]
    shape: dict[str, Any] = {"width": width, "height": height, "simt": simt, "release": release}
    setup, setup_work, _ = triangle_setup(
        positions, triangles, **shape, samples=samples, cull_backfaces=options["cull_backfaces"],
        depth=depth, interpolate=interpolate, capacity=2**31,
    )  # fmt: skip
    queues, bin_work, _ = bins.bin_raster(setup, **shape)
    lists, tile_work, _ = tiles.coarse_raster(queues, setup, deferred_clear=True, **shape)
    area = tile_areas(setup, lists, width, height)
    fine_work = sample.stage(
        np.diff(lists.starts)[lists.active],
        lambda units: fine_raster(
            setup, lists.starts, lists.entries, lists.active[units], **shape, samples=samples, mode=mode,
            starts=False,
        )[1],
        lambda table: fine_streams(_started(table, simt), setup, len(lists.entries), width, height, samples),
        (area[lists.active],),
    )  # fmt: skip
    variant = "" if release == "nvdiffrast" else mode if samples == 1 else f"{mode} msaa"
    return [replace(setup_work, variant=mode), bin_work, tile_work, replace(fine_work, variant=variant)]


def _started(table: NDArray[np.int64], simt: Simt) -> NDArray[np.int64]:
    """Add to the rows of all tiles what the warps do besides; in place."""
    count_starts(table, WARPS * simt.sms, 128 if simt.coalescing == WARP_LINES else 32)
    return table
