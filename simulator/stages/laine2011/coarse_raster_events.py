"""What coarse raster counts: the cost drivers of Laine & Karras 2011, section 5."""

from enum import IntEnum


class CoarseRasterEvent(IntEnum):
    """Events of one draw from the bin queue, a column each."""

    CTA_STARTS = 0  # blocks that start, each sorting the bins (the rows in front)
    BINS = 1  # bins processed
    ROUNDS = 2
    ROUND_WARPS = 3  # warps with an entry
    MERGES = 4  # merge attempts, with the one of each bin that finds no segment left
    MERGE_WARPS = 5  # warps that copy entries of a segment
    TRIANGLES = 6  # entries: bin-triangle pairs
    INDIRECT_WARPS = 7  # warps that look up the run of a clipped triangle first
    BOX_TILES = 8  # tiles in the boxes of all entries
    CASE_A_WARPS = 9
    CASE_B_WARPS = 10
    CASE_B_STEPS = 11  # votes of those: tiles in the union of the warp's boxes
    CASE_C_WARPS = 12
    CASE_C_STEPS = 13  # steps of those: tiles in the largest box
    CASE_C_LANE_STEPS = 14  # edge tests of those: tiles in the boxes
    TILES_TOUCHED = 15  # tiles with an emit, summed over rounds
    EMITS = 16  # tile-triangle pairs
    EMIT_STEPS = 17  # block-wide steps that write up to 512 emits
    EMIT_WARPS = 18  # warps of those
    SEGMENTS = 19  # new tile segments
    ALLOC_ROUNDS = 20  # rounds that need a segment
    ACTIVE_TILES = 21  # tiles handed on to fine raster
    SHARED_ATOMIC = 22
    BANK_REPLAYS = 23  # further passes of the shared ORs
    ATOMIC = 24  # draws, segment allocations and active tiles
    ATOMIC_LANES = 25
    ATOMIC_REQUESTS = 26
    ATOMIC_DEPTH = 27
    LOAD = 28  # of entries and headers
    LOAD_TRANSACTIONS = 29
    LOAD_BYTES = 30
    STORE_TRANSACTIONS = 31  # of the queue entries
    STORE_BYTES = 32
    BIN_WARPS = 33  # warps of a block with a bin to sort
    SORT_WARPS = 34  # warps of its sort of 16 bins each
    SORT_MERGES = 35  # block-wide merges of sorted runs
    SORT_STEPS = 36  # steps of their binary searches, by warp
    CASE_B_ROWS = 37  # rows of the union boxes of case B
    SCAN_WARPS = 38  # warps of 32 tiles that add up emits in shared memory, as a tile has two or more
    EMIT_BLOCK_WARPS = 39  # warps that write emits in a round
    SEGMENT_WARPS = 40  # warps that write links and counts of new segments
    LINK_WARPS = 41  # warps of 32 tiles with a new segment
    FIRST_WARPS = 42  # warps of those with a tile's first segment
    ACTIVE_WARPS = 43  # warps of 32 tiles with an active tile
    STREAM_READS = 44  # merges that find a segment
    LONGEST_B = 45  # CASE_B_STEPS of the warp of each round that takes most: the others wait for it
    LONGEST_C = 46  # CASE_C_STEPS, likewise
    CASE_A_ROUNDS = 47  # rounds with a warp of case A
    WIDE_ROUNDS = 48  # rounds with a warp of case B or C
    CASE_B_LANE_STEPS = 49  # edge tests of case B: tiles in the boxes of its triangles
    CASE_B_LANE_ROWS = 50  # CASE_B_ROWS, by triangle
