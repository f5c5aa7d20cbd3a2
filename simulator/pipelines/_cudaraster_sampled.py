"""CudaRaster where numbers are wanted within an error: part of the tiles are drawn, and no picture."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.simt import Simt
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines._cudaraster_facts import first_room
from tilestamp.simulator.sampling.executor import Sampler
from tilestamp.simulator.stages.laine2011 import bin_raster as bins
from tilestamp.simulator.stages.laine2011 import coarse_raster as tiles
from tilestamp.simulator.stages.laine2011.fine_raster import (
    MODES,
    WARPS,
    count_starts,
    fine_raster,
    fine_streams,
)
from tilestamp.simulator.stages.laine2011.sampled_tiles import tile_areas
from tilestamp.simulator.stages.laine2011.triangle_setup import BLOCK, MAX_SUBTRIANGLES, triangle_setup
from tilestamp.simulator.work import Work


def sampled_draw(
    sample: Sampler,
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    options: dict[str, Any],
    *,
    first_frame: bool,
) -> Frame:
    """One draw: all triangles set up, binned and listed; counted in part of the blocks, and drawn in part of the tiles.

    Where a queue is too small for the first attempt of a first frame, the stages up to it stand among the works once
    more.

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
        ``release``, ``samples``, ``mode``, ``cull_backfaces`` and ``guard_band``.
    first_frame : bool
    """
    release, samples, mode = options["release"], options["samples"], options["mode"]
    depth, _, _, interpolate = MODES[mode]
    shape: dict[str, Any] = {"width": width, "height": height, "simt": simt, "release": release}
    prepare: Callable[..., Any] = partial(
        triangle_setup, positions, **shape, samples=samples, cull_backfaces=options["cull_backfaces"],
        guard_band=options["guard_band"],
        depth=depth, interpolate=interpolate, capacity=MAX_SUBTRIANGLES,
    )  # fmt: skip
    setup, all_of_it, facts = prepare(triangles, counting=False)
    visible = np.add.reduceat(setup.subtriangles > 0, np.arange(0, len(triangles), BLOCK), dtype=np.int64)
    setup_work = sample.stage(visible, partial(_count_setup, prepare, triangles, mode), lambda _: all_of_it.streams)
    queues, bin_work, bin_facts = bins.bin_raster(setup, **shape)
    lists, tile_work, tile_facts = tiles.coarse_raster(queues, setup, deferred_clear=True, **shape)
    variant = "" if release == "nvdiffrast" else mode if samples == 1 else f"{mode} msaa"
    area = tile_areas(setup, lists, width, height)
    fine_work = sample.stage(
        np.diff(lists.starts)[lists.active],
        lambda units: replace(
            fine_raster(
                setup, lists.starts, lists.entries, lists.active[units], **shape, samples=samples, mode=mode,
                starts=False,
            )[1],
            variant=variant,
        ),
        lambda table: fine_streams(_started(table, simt), setup, len(lists.entries), width, height, samples),
        (area[lists.active],),
    )  # fmt: skip
    works = [setup_work, bin_work, tile_work, fine_work]
    needed = facts["numSubtris"], bin_facts["num_bin_segments"], tile_facts["num_tile_segments"]
    room = first_room(len(triangles), width, height).values()
    failed = [works[:last] for last, (most, first) in enumerate(zip(needed, room, strict=True), 1) if most > first]
    return Frame.numbers([*chain(*failed), *works] if first_frame else works, {"retries": len(failed)})


def _started(table: NDArray[np.int64], simt: Simt) -> NDArray[np.int64]:
    """Add to the rows of all tiles what the warps do besides; in place."""
    count_starts(table, WARPS * simt.sms, smallest_transaction_bytes(int(simt.coalescing)))
    return table


def _count_setup(
    prepare: Callable[..., Any], triangles: NDArray[np.int32], mode: str, units: NDArray[np.int64]
) -> Work:
    """Blocks ``units`` of triangle setup, one after another: what a block does does not hang on those before it."""
    order = np.argsort(units)  # a block that is not full comes last
    some = (units[order, None] * BLOCK + np.arange(BLOCK)).ravel()
    work: Work = prepare(triangles[some[some < len(triangles)]])[1]
    return replace(work, table=work.table[np.argsort(order)], variant=mode)
