"""Stamps: the samples of n x n pixels tested at once (Pineda 1988; Fatahalian et al. 2009, the baseline).

Stamps are aligned to the screen. Those that touch the polygon's box are tested, or, with ``touch="polygon"``, only
those that the polygon itself reaches. With a coarse stamp (Greene 1996), a coarse stamp that the polygon does not reach
is culled, one that it fills is accepted without a sample test, and only the others are cut into stamps.

A warp draws 256 polygons from a queue and takes them one by one: its lanes sort the stamps of the box (and the coarse
ones) 32 at a time, then test the samples of as many whole stamps as fit a warp, or a warp's worth of one stamp.
"""

from typing import Any, Literal

import numpy as np

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import new_setup
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, draw_in_parts, units_of
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.stamps_chunk import draw_chunks
from tilestamp.simulator.stages.fatahalian2009.stamps_events import CHUNK, StampsEvent, StampShape
from tilestamp.simulator.stages.fatahalian2009.warp_queue import sample_streams, warp_queue

Touch = Literal["box", "polygon"]


def stamp_shape(stamp: int | tuple[int, ...], touch: Touch, coarse: int = 0) -> StampShape:
    """Check the options of stamps; raises TilestampError."""
    width, height = (stamp, stamp) if isinstance(stamp, int) else stamp
    if coarse and (coarse < max(width, height) or coarse % width or coarse % height):
        raise TilestampError(f"a coarse stamp is a whole number of {width}x{height} stamps wide and high, not {coarse}")
    return StampShape(width, height, touch == "polygon", coarse)


def stamps(polygons: Micropolygons, samples: Samples, shape: StampShape, simt: Simt) -> StageResult[Samples]:
    """Draw ``polygons`` into ``samples``.

    Parameters
    ----------
    polygons : Micropolygons
    samples : Samples
        Written.
    shape : StampShape
    simt : Simt

    Returns
    -------
    outputs : Samples
    works : one, a row for each chunk of 256 polygons
    """
    units = -(-len(polygons.patch) // CHUNK)
    table = np.zeros((units, len(StampsEvent)), np.int64)
    draw_in_parts(_stamps, units, samples, polygons.vertices, shape, Simt(*map(int, simt)), table)
    streams = sample_streams(polygons.vertices.nbytes, samples, StampsEvent, table)
    work = warp_queue("stamps", StampsEvent, table, simt, streams=streams, atomic_requests=samples.requests)
    return StageResult(samples, (work,))


@kernel
def _stamps(part: int, parts: int, samples: Samples, vertices: Any, shape: StampShape, simt: Simt, table: Any) -> None:
    scratch = new_setup(), np.empty(simt.warp, np.int64)
    draw_chunks(units_of(part, parts, len(table)), samples, vertices, shape, simt, table, *scratch)
