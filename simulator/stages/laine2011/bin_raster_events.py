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
    CTA_BIN_WARPS = 39  # warps with a bin of the frame, at the start of a block: they clear its totals
    BIN_WARPS = 40  # the same in each round: they count the bins' entries and move their ends
    BIN_LANES = 41  # bins of those
    MASK_CLEARS = 42  # turns in which warps clear their masks, 32 bins each
    VISIBLE_WARPS = 43  # warps of a read with a visible triangle
    MULTI_WARPS = 44  # warps of a read with a triangle of several sub-triangles
    WALK_STEPS = 45  # steps of warps over the boxes of their triangles, to write entries
    ROW_ENDS = 46  # steps of slow warps at which a lane ends a row of its box
    CLOSING_WARPS = 47  # warps of bins with an open segment, at the end of a batch
    LONGEST_WALKS = 48  # WALK_STEPS of the warp of each round that takes most: the others wait for it
    LONGEST_SLOW = 49  # SLOW_STEPS, likewise
    SINGLE_ROUNDS = 50  # rounds with a single warp
    FAST_ROUNDS = 51  # rounds with a fast warp
    SLOW_ROUNDS = 52  # rounds with a slow warp
    MASK_WARPS = 53  # warps that clear their masks in a round
    MASK_LANES = 54  # lanes of those: fewer than 32 where the frame has fewer bins
