"""What FreePipe counts: the cost drivers of one thread a triangle (Liu et al. 2010)."""

from enum import IntEnum

from tilestamp.models.counters import shown
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS


@shown(*SAMPLE_COUNTERS)
class FreePipeEvent(IntEnum):
    """Events of one block, a column each."""

    WARPS = 0  # warps with a triangle
    LANES_IN = 1  # triangles
    CLIP_WARPS = 2  # warps in which a lane clips
    CLIP_LANES = 3
    SETUP_STEPS = 4  # warp executions of the set-up of a scan
    SETUP_LANES = 5
    ROW_STEPS = 6  # turns of the outer loop
    ROW_LANES = 7
    WARP_STEPS = 8  # turns of the inner loop: one sample test of each lane
    SAMPLE_TESTS = 9  # lanes of those
    SAMPLE_HITS = 10
    READS = 11  # early: loads of the pixel before the atomic
    ATOMIC = 12
    ATOMIC_LANES = 13
    ATOMIC_REQUESTS = 14
    ATOMIC_CONFLICTS = 15
    ATOMIC_DEPTH = 16
    LOAD_TRANSACTIONS = 17
    LOAD_BYTES = 18
    CHAIN_STEPS = 19  # steps of the block's longest warp, for what nothing else hides
    CHAIN_ROWS = 20  # its turns of the outer loop
    CHAIN_HITS = 21  # its steps in which a lane hits
    REST_STEPS = 22  # steps of WARP_STEPS before the unrolled loop
    BOX_STEPS = 23  # set-ups in which a lane has a pixel to test
    CLIP_HITS = 24  # steps of clipped triangles in which a lane hits
    BOX_LANES = 25  # lanes of BOX_STEPS with a pixel: the others have left
