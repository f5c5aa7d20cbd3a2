"""Events of the stages, a row a block: what counts, and what reports show of it.

``X_WARPS`` counts the executions of a piece of code by a warp, ``X_LANES`` the lanes active meanwhile. Events that bear
the name of a machine event are sectors by the machine's coalescing rule.
"""

from enum import IntEnum

from tilestamp.models.counters import count, distribution, ratio, shown


@shown(
    count("GAUSSIANS", "Gaussians"),
    count("VISIBLE", "Gaussians in the list of a tile"),
    count("CULLED_NEAR", "Gaussians nearer than 0.2"),
)
class ProjectEvent(IntEnum):
    """Events of a block of 256 threads, a Gaussian each."""

    WARPS = 0  # that have a Gaussian
    GAUSSIANS = 1  # lanes that have one
    NEAR_WARPS = 2  # with a lane behind the near test: the covariance in space and on the screen
    NEAR_LANES = 3
    SQUARE_WARPS = 4  # with a lane whose determinant is not zero: radius, position, tiles
    SQUARE_LANES = 5
    VISIBLE_WARPS = 6  # with a lane that stores
    VISIBLE = 7  # such lanes
    CULLED_NEAR = 8  # lanes
    CULLED_DETERMINANT = 9
    CULLED_SCREEN = 10  # of which no tile is on the screen
    LOAD_TRANSACTIONS = 11
    LOAD_BYTES = 12
    STORE_TRANSACTIONS = 13
    STORE_BYTES = 14
    BLOCKS = 15  # 1: what the chain of a block is priced on


@shown(count("PAIRS", "pairs of Gaussian and tile"))
class TightCountEvent(IntEnum):
    """Events of a block of 256 threads that counts the tiles of its Gaussians by box or ellipse."""

    WARPS = 0
    LANES = 1
    VISIBLE_WARPS = 2  # with a lane of radius > 0
    VISIBLE_LANES = 3
    OPAQUE_WARPS = 4  # with a lane whose opacity reaches 1/255: extents
    OPAQUE_LANES = 5
    ROW_TRIPS = 6  # iterations over rows of tiles: of each warp those of its longest lane
    ROW_LANES = 7
    LONGEST_ROW_TRIPS = 8  # of the warp with most
    PAIRS = 9
    LOAD_TRANSACTIONS = 10
    LOAD_BYTES = 11
    STORE_TRANSACTIONS = 12
    STORE_BYTES = 13
    BLOCKS = 14


@shown(
    count("PAIRS", "pairs of Gaussian and tile"),
    count("TRIPS", "warp iterations of the loop over tiles", "duplicate_trips"),
    distribution("longest_list_of_a_thread", "LONGEST_TRIPS", "tiles of the largest Gaussian of a block"),
)
class DuplicateEvent(IntEnum):
    """Events of a block of 256 threads, each of which writes the pairs of a Gaussian."""

    WARPS = 0
    GAUSSIANS = 1
    VISIBLE_WARPS = 2  # with a lane of radius > 0
    VISIBLE_LANES = 3
    ROW_TRIPS = 4  # iterations over rows of tiles: of each warp those of its longest lane
    ROW_LANES = 5
    TRIPS = 6  # iterations over tiles: of each warp those of its longest lane
    PAIRS = 7  # lanes of them: a pair each
    LONGEST_TRIPS = 8  # of the warp with most
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12
    BLOCKS = 13
    LONGEST_ROW_TRIPS = 14  # of the warp with most
    STEPS = 15  # pairs stored by a warp, an instruction each: lanes whose rows differ in width take turns


class SortEvent(IntEnum):
    """Events of one block of a pass over a digit of 8 bits, or of the histogram of all digits."""

    WARPS = 0
    PAIRS = 1
    DIGITS = 2  # digit values in the block: runs that it writes
    DIGITS_USED = 3  # digit values in all pairs, counted in the first block
    LOAD_TRANSACTIONS = 4
    LOAD_BYTES = 5
    STORE_TRANSACTIONS = 6  # sectors of the runs
    STORE_BYTES = 7
    BLOCKS = 8
    PASSES = 9  # digits a key that the block looks at: all in the histogram, else 1
    ALIKE = 10  # 1 where all pairs of the block have one digit: a short way
    MIXED = 11  # 1 where they have several
    LISTED = 12  # 1 where the block of the histogram has any pairs
    ATOMIC = 13  # instructions that add the block's counts to those of all
    ATOMIC_LANES = 14
    ATOMIC_REQUESTS = 15


@shown(count("LISTED_TILES", "tiles with pairs"))
class RangesEvent(IntEnum):
    """Events of a block of 256 threads, a pair each."""

    WARPS = 0
    PAIRS = 1
    EDGE_WARPS = 2  # with a lane whose pair is the first of a tile
    LISTED_TILES = 3  # such lanes
    LOAD_TRANSACTIONS = 4
    LOAD_BYTES = 5
    STORE_TRANSACTIONS = 6
    STORE_BYTES = 7
    BLOCKS = 8


@shown(
    count("EVALUATIONS", "evaluations of a Gaussian at a pixel", "sample_tests"),
    count("BLENDED", "evaluations that were blended", "sample_hits"),
    ratio("ste", "BLENDED", "EVALUATIONS", "sample test efficiency: evaluations that were blended by all"),
    count("STOPPED", "pixels that grew opaque"),
    distribution("list", "LIST", "Gaussians in the list of a tile"),
)
class BlendEvent(IntEnum):
    """Events of one block, which is a tile.

    A trip is an iteration of a warp over a list entry. With several pixels a thread it has a step for each pixel of
    which a lane is not done; with one, steps are trips.
    """

    WARPS = 0
    THREADS = 1
    LIST = 2  # entries of the tile
    BATCHES = 3  # rounds entered: all threads meet at barriers, and each loads an entry
    ENTRIES = 4  # entries loaded to shared memory
    GATHER_WARPS = 5  # warps that load some
    WARP_BATCHES = 6  # rounds that a warp enters with a lane that is not done
    TRIPS = 7
    STEPS = 8
    EVALUATIONS = 9  # lanes of the steps
    EXP_STEPS = 10  # steps with a lane whose power is not positive
    EXP_LANES = 11
    BLEND_STEPS = 12  # steps with a lane that blends; the first blend of a trip gathers the colour
    BLENDED = 13  # lanes of them
    BLEND_TRIPS = 14  # trips with such a step
    SKIPPED_POWER = 15  # evaluations that are not blended: power positive
    SKIPPED_ALPHA = 16  # alpha below 1/255
    STOPPED = 17  # the pixel would grow opaque: it is done
    IDLE_LANES = 18  # lanes of the steps that are done or off screen
    SLOWEST_TRIPS = 19  # of each round, the warp with most steps, blending ones three times: its trips
    SLOWEST_STEPS = 20  # its steps
    SLOWEST_BLEND_STEPS = 21  # its blending steps
    SLOWEST_RUNS = 22  # its blending steps that follow one that does not blend
    SLOWEST_OWN_BLENDS = 23  # its entries that no other warp blends: their colours were not fetched before
    COLOUR_FETCHES = 24  # entries that some warp blends
    LEFT = 25  # 1 where all pixels were done before the end of the list
    PIXELS = 26  # on the screen
    PIXEL_WARPS = 27  # stores of a pixel by a warp: steps of the last part of the kernel
    LOAD_TRANSACTIONS = 28
    LOAD_BYTES = 29
    STORE_TRANSACTIONS = 30
    STORE_BYTES = 31
    BLOCKS = 32


@shown(
    count("EVALUATIONS", "evaluations of a Gaussian at a pixel", "sample_tests"),
    count("BLENDED", "evaluations that were blended", "sample_hits"),
    count("INSERTED", "Gaussians that a pixel sorted into its window"),
    count("STOPPED", "pixels that grew opaque"),
    count("EARLY", "blended behind what is farther: the window was too short"),
)
class ResortEvent(IntEnum):
    """Events of one block of the loop that sorts at each pixel; a block is a tile and has a thread a pixel."""

    WARPS = 0
    THREADS = 1
    LIST = 2
    BATCHES = 3
    ENTRIES = 4
    GATHER_WARPS = 5  # warps that load some, and make the rows that depths along rays need
    WARP_BATCHES = 6
    STEPS = 7
    EVALUATIONS = 8  # lanes of the steps
    EXP_STEPS = 9  # steps with a lane whose power is not positive
    EXP_LANES = 10
    INSERT_STEPS = 11  # steps with a lane whose alpha is not too small: depth, and a place in the window
    INSERTED = 12  # lanes of them
    SLOTS = 13  # places of the window that such steps go through: all of them, since it lies in registers
    SLOT_LANES = 14
    BLEND_STEPS = 15  # steps with a lane whose window is full, or is emptied at the end
    BLENDED = 16
    STOPPED = 17
    DROPPED = 18  # left in the windows of pixels that grew opaque
    EARLY = 19  # blends that are nearer than the one before at their pixel
    IDLE_LANES = 20
    SLOWEST_STEPS = 21  # of the warp with most to do
    SLOWEST_SLOTS = 22
    SLOWEST_BLEND_STEPS = 23
    PIXELS = 24
    PIXEL_WARPS = 25
    LOAD_TRANSACTIONS = 26
    LOAD_BYTES = 27
    STORE_TRANSACTIONS = 28
    STORE_BYTES = 29
    BLOCKS = 30


@shown(
    count("EVALUATIONS", "evaluations of a Gaussian at a pixel, from the last that it blended back", "sample_tests"),
    count("BLENDED", "evaluations that have gradients", "sample_hits"),
    ratio("ste", "BLENDED", "EVALUATIONS", "evaluations that have gradients by all"),
)
class GradientEvent(IntEnum):
    """Events of one block of the backward pass, which is a tile."""

    WARPS = 0
    BATCHES = 1  # rounds: the whole list, from its end
    ENTRIES = 2
    STEPS = 3  # iterations of a warp over a list entry, whether it used the entry or not
    WALK_STEPS = 4  # of them: with a lane that had come so far
    EVALUATIONS = 5  # such lanes
    BLEND_STEPS = 6  # with a lane that blended the entry: gradients
    BLENDED = 7  # such lanes
    REDUCED_STEPS = 8  # steps whose gradients a warp adds up before one lane adds them to memory
    ATOMIC = 9  # instructions of warps: nine a step
    ATOMIC_LANES = 10
    ATOMIC_REQUESTS = 11
    ATOMIC_CONFLICTS = 12
    ATOMIC_DEPTH = 13
    LOAD_TRANSACTIONS = 14
    LOAD_BYTES = 15
    BLOCKS = 16
