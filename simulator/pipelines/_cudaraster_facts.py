"""What cudaraster reports besides the picture: the counters of the authors' profiler, and the memory of its queues."""

from typing import Any

from tilestamp.simulator.stages.laine2011 import bin_raster as bins
from tilestamp.simulator.stages.laine2011 import coarse_raster as tiles
from tilestamp.simulator.stages.laine2011.fine_raster_queue import FineRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup import SLACK, SUBTRIANGLE_BYTES
from tilestamp.simulator.stages.laine2011.triangle_setup_count import TriangleSetupEvent
from tilestamp.simulator.work import Work

REMARKS = {
    "retries": "{:,} attempts of a first frame fail for want of room in a queue (-O first_frame=True prices them)",
    "fragments_lost": "{:,} fragments found no room in the list of their pixel, and are missing",
}
Counters = dict[str, tuple[int, int]]  # numerator and denominator by the profiler's own name


def first_room(triangles: int, width: int, height: int) -> dict[str, int]:
    """Room that the first attempt of a draw has, by queue, in the order in which they are filled."""
    return {
        "numSubtris": triangles + SLACK,
        "numBinSegs": bins.initial_capacity(triangles, width, height),
        "numTileSegs": tiles.initial_capacity(triangles, width, height),
    }


def setup_counters(setup: Work, fine: Work, drawn: int, triangles: int) -> Counters:
    """Counters of triangle setup; ``drawn`` triangles of ``triangles`` have a sub-triangle."""
    E = TriangleSetupEvent
    return {
        "TriangleSetup / Viewport cull": (100 * setup.total(E.VIEWPORT_CULLED), triangles),
        "TriangleSetup / Backface cull": (100 * setup.total(E.BACKFACE_CULLED), triangles),
        "TriangleSetup / Between pixels cull": (100 * setup.total(E.BETWEEN_CULLED), triangles),
        "TriangleSetup / Clipped": (100 * setup.total(E.CLIP_LANES), triangles),
        "TriangleSetup / Avg. samples / tri": (fine.total(FineRasterEvent.SAMPLE_HITS), drawn),
    }


def fine_counters(fine: Work, *, depth: bool, msaa: int) -> Counters:
    """Counters of fine raster."""
    E = FineRasterEvent
    lanes, entries = 32 * fine.total(E.SEGMENTS), fine.total(E.ENTRY_LANES)
    covered, fragments = fine.total(E.COVERAGE_LANES), fine.total(E.FRAGMENT_LANES)
    tiles = len(fine.table)
    return {
        "FineRaster / Triangles culled / End of stream": (100 * (lanes - entries), lanes),
        "FineRaster / Triangles culled / Early Z kill": (
            100 * fine.total(E.EARLY_Z_KILLS),
            fine.total(E.EARLY_Z_LANES),
        ),
        "FineRaster / Triangles culled / Empty coverage": (100 * fine.total(E.EMPTY_MASKS), covered),
        "FineRaster / Z kills": (100 * fine.total(E.Z_KILLS), fragments if depth else 0),
        "FineRaster / MSAA kills": (100 * fine.total(E.MSAA_KILLS), fragments if msaa > 1 else 0),
        "FineRaster / Post-kill warp util.": (100 * fine.total(E.SHADE_LANES), 32 * fine.total(E.SHADE_ROUNDS)),
        "FineRaster / Blend attempt rounds": (fine.total(E.BLEND_ROUND_LANES), fine.total(E.BLEND_LANES)),
        "FineRaster / Avg. tri/tile": (entries, tiles),
        "FineRaster / Avg. frag/tri": (fragments, covered),
        "FineRaster / Avg. frag/tile": (fragments, tiles),
    }


def add_counters(sums: Counters, more: Counters) -> Counters:
    """Sum numerators and denominators over the batches of a frame."""
    return {name: (n + sums.get(name, (0, 0))[0], d + sums.get(name, (0, 0))[1]) for name, (n, d) in more.items()}


def frame_facts(sums: Counters, queues: dict[str, int], release: str, retries: int) -> dict[str, Any]:
    """Facts of a frame.

    Parameters
    ----------
    sums : dict
        Counters over all batches.
    queues : dict
        numSubtris, numBinSegs and numTileSegs, the largest of any batch.
    release : str
    retries : int
        Draws that were repeated because a buffer was too small.
    """
    megabytes = {
        "setup data": queues["numSubtris"] * SUBTRIANGLE_BYTES[release] / 2**20,
        "bin queues": queues["numBinSegs"] * bins.SEGMENT_BYTES / 2**20,
        "tile queues": queues["numTileSegs"] * tiles.SEGMENT_BYTES / 2**20,
    }
    return {
        **queues,
        "memory_mb": megabytes,
        "counters": {name: n / max(d, 1) for name, (n, d) in sums.items()},
        "counter_sums": sums,
        "retries": retries,
    }
