"""Events of the two kernels that blend by macro tiles and batches, and what reports show of them."""

from enum import IntEnum

from tilestamp.models.counters import count, distribution, ratio, shown


@shown(
    count("EVALUATIONS", "evaluations of a Gaussian at a pixel", "sample_tests"),
    count("BLENDED", "evaluations that were blended", "sample_hits"),
    ratio("ste", "BLENDED", "EVALUATIONS", "sample test efficiency: evaluations that were blended by all"),
    count("MASK_TESTS", "tests of a Gaussian against a tile of its macro tile"),
    count("MASK_BITS", "pairs of Gaussian and tile: tests that hit"),
    count("STOPPED", "pixels that grew opaque within a batch"),
    count("PARTIAL_BYTES", "bytes of partial results"),
    distribution("list", "ENTRIES", "Gaussians of a batch"),
)
class BatchEvent(IntEnum):
    """Events of one block, which is a batch of a macro tile."""

    WARPS = 0
    ENTRIES = 1
    MINI_BATCHES = 2  # warps that load entries and make their masks
    MASK_ROWS = 3  # rows of tiles that such a warp goes through
    MASK_TESTS = 4  # entries by the tiles of a macro tile
    MASK_BITS = 5  # tests that hit: pairs of the lists at the size of a tile
    MASK_ROUNDS = 6  # mini-batches of the warp with most
    TILES = 7  # drawn from the queue: those with a bit
    TILE_STEPS = 8  # of them, by the pixels of a lane
    MASKS_READ = 9  # of mini-batches, by warps that fill their ring with entries of their tile
    DRAINS = 10  # of a ring
    TRIPS = 11  # entries that a warp evaluates at the pixels of its tile
    STEPS = 12  # of them, by the pixels of a lane: whether these are done or not
    EVALUATIONS = 13  # lanes of the steps whose pixel is not done in this batch
    BLENDED = 14
    STOPPED = 15  # the pixel would grow opaque: it is done
    IDLE_LANES = 16  # lanes of the steps that are done or off screen
    SLOWEST_STEPS = 17  # of the warp with most steps and masks: its steps
    SLOWEST_TRIPS = 18
    SLOWEST_MASKS = 19
    SLOWEST_TILES = 20
    PARTIAL_BYTES = 21
    LOAD_TRANSACTIONS = 22
    LOAD_BYTES = 23
    STORE_TRANSACTIONS = 24
    STORE_BYTES = 25
    BLOCKS = 26


@shown(count("PARTIALS", "partial results of tiles that were blended"))
class PartialEvent(IntEnum):
    """Events of one block of 256 threads, in which a warp blends the batches of a tile in order."""

    WARPS = 0  # that have a tile
    BATCHES = 1  # of their macro tiles that they look at
    PARTIALS = 2  # of them, with an entry in the tile
    PARTIAL_STEPS = 3  # of them, by the pixels of a lane
    PIXEL_STEPS = 4  # of a warp, by the pixels of a lane
    PIXELS = 5  # on the screen
    SLOWEST_BATCHES = 6  # of the warp with most partial results
    SLOWEST_PARTIALS = 7
    LOAD_TRANSACTIONS = 8
    LOAD_BYTES = 9
    STORE_TRANSACTIONS = 10
    STORE_BYTES = 11
    BLOCKS = 12
