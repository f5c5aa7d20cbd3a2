"""The clears of a frame (Zhang 2025): buffers that a frame starts from, set before its first kernel or in parallel.

The fragment stream has room for 4 fragments of 48 bytes a pixel: its 398 MB at 1920x1080 are most of what is cleared.
"""

from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILES
from tilestamp.simulator.stages.zhang2025.fine_rasterizer import FRAGMENT_BYTES
from tilestamp.simulator.stages.zhang2025.pixel_shader import OVERDRAW
from tilestamp.simulator.stages.zhang2025.primitive_assembly import PRIMITIVE_BYTES
from tilestamp.simulator.stages.zhang2025.primitive_binning import MAX_BINS
from tilestamp.simulator.stages.zhang2025.primitive_compaction import SLOTS_A_TRIANGLE

BLOCK = 256  # threads of the runtime's memset, four words each (assumed)
MOST_SUB_QUEUES = 2046  # of binning blocks
QUEUES_A_TILE = 4  # chunks that a tile can list


def cleared_bytes(triangles: int, pixels: int) -> dict[str, int]:
    """Bytes of each buffer that is cleared, in the order of the source."""
    return {
        "bin_allocator": 4,
        "tile_allocator": 4,
        "quad_allocator": 4,
        "slot_counter": 4,
        "fragments": OVERDRAW * pixels * FRAGMENT_BYTES,
        "target": 16 * pixels,
        "hi_z": 4 * MAX_BINS * TILES,
        "depth": 4 * pixels,
        "primitives": SLOTS_A_TRIANGLE * triangles * PRIMITIVE_BYTES,
        "pixel_base": 4 * pixels,
        "bin_counts": 4 * MOST_SUB_QUEUES * MAX_BINS,
        "tile_counts": 4 * MAX_BINS * TILES * QUEUES_A_TILE,
        "block_sums": 4096,
        "block_sum": 4,
    }


def frame_clears(triangles: int, pixels: int, simt: Simt) -> StageResult[None]:
    """Set all buffers of a frame to their start values.

    Parameters
    ----------
    triangles, pixels : int
    simt : Simt

    Returns
    -------
    works : one for each buffer, whose name is the variant
    """
    works = (
        thread_per_item("Clears", "Clear", -(-size // 16), BLOCK, simt, stores=(Access(name, 16, 1, 16),), variant=name)
        for name, size in cleared_bytes(triangles, pixels).items()
    )
    return StageResult(None, tuple(works))
