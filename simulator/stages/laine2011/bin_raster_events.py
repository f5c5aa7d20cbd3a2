"""What bin raster counts: the cost drivers of Laine & Karras 2011, section 4."""

from enum import IntEnum


class BinRasterEvent(IntEnum):
    """Events of one draw from the batch queue, a column each."""

    CTA_STARTS = 0  # blocks that start and end (the rows in front)
    BATCHES = 1  # batches drawn
    READ_STEPS = 2  # block-wide reads of 512 sub-triangle counts, with their compaction
    READ_WARPS = 3  # warps of those with a triangle to read
    READ_LANES = 4  # triangles read, again after an overflow included
    VISIBLE_LANES = 5  # triangles read that have a sub-triangle
    ENTRIES = 6  # sub-triangles put into the ring
    OVERFLOWS = 7  # reads cut short because the ring was full
    ROUNDS = 8  # rounds, empty ones included
    ROUND_WARPS = 9  # warps of those with a triangle
    TRIANGLES = 10  # lanes of those: triangles binned
    INDIRECT_WARPS = 11  # warps that look up the run of a clipped triangle first
    BOX_BINS = 12  # bins in the boxes of all triangles
    SINGLE_WARPS = 13
    SINGLE_LANES = 14
    SINGLE_LOOPS = 15  # distinct bins, summed over single warps: turns of the vote in release 1.1
    FAST_WARPS = 16
    FAST_LANES = 17
    SLOW_WARPS = 18
    SLOW_LANES = 19
    SLOW_STEPS = 20  # steps that slow warps walk: as many as the largest box has bins
    SLOW_LANE_STEPS = 21  # edge tests: bins in the boxes of slow warps' triangles
    ENQUEUE_STEPS = 22  # steps at which a warp writes entries
    EMITS = 23  # entries written: bin-triangle pairs
    SEGMENTS = 24  # new bin segments
    ALLOC_ROUNDS = 25  # rounds that need a segment
    ALLOC_WARPS = 26  # warps of bins with a new segment, each a shared add
    CLOSED_SEGMENTS = 27  # segments open at the end of the batch
    SHARED_ATOMIC = 28
    BANK_REPLAYS = 29  # further passes of the shared ORs
    ATOMIC = 30  # draws and segment allocations
    ATOMIC_LANES = 31
    ATOMIC_REQUESTS = 32
    ATOMIC_DEPTH = 33
    LOAD = 34
    LOAD_TRANSACTIONS = 35
    LOAD_BYTES = 36
    STORE_TRANSACTIONS = 37  # of the queue entries
    STORE_BYTES = 38
