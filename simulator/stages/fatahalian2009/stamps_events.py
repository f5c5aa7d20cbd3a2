"""What stamps count, and how they are laid."""

from enum import IntEnum
from typing import NamedTuple

from tilestamp.models.counters import shown
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS

CHUNK = 256  # polygons that a warp draws from the queue


@shown(*SAMPLE_COUNTERS)
class StampsEvent(IntEnum):
    """Events of one chunk of polygons."""

    POLYGONS = 0  # set up, the whole warp doing the same
    COARSE_STAMPS = 1  # coarse stamps sorted into culled, filled and others
    COARSE_WARPS = 2  # warp executions of that
    BOX_STAMPS = 3  # stamps of the box, or of the coarse stamps left, that are looked at
    BOX_WARPS = 4  # warp executions of that
    STAMPS = 5  # stamps tested
    TEST_WARPS = 6  # warp executions of the sample test
    SAMPLE_TESTS = 7
    SAMPLE_HITS = 8  # hits by tests
    FILLED_SAMPLES = 9  # hits of filled coarse stamps: no test
    FILLED_WARPS = 10
    HIT_WARPS = 11  # warp executions of depth and atomic
    ATOMIC_LANES = 12
    ATOMIC_REQUESTS = 13
    ATOMIC_DEPTH = 14  # 1 each: the lanes test different samples of one polygon
    LOAD_TRANSACTIONS = 15
    LOAD_BYTES = 16


class StampShape(NamedTuple):
    """How stamps are laid and chosen: pixels, and pixels of the coarse stamp (0: one level)."""

    width: int
    height: int
    polygon: bool  # only stamps that the polygon reaches
    coarse: int
