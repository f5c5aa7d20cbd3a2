"""Clears of each frame (Ru 2016): the colours always; with tiles the list counters, else fragments and depth.

A tile writes every fragment and depth of its pixels, so the tiled path has nothing else to clear.
"""

from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item

BLOCK = 256  # threads of the runtime's memset, four words each (assumed)


def clear(width: int, height: int, tiles: int, simt: Simt) -> StageResult[None]:
    """Set all buffers of a frame to their start values.

    Parameters
    ----------
    width, height : int
        Pixels.
    tiles : int
        Tiles with a counter each; 0 without tiles.
    simt : Simt

    Returns
    -------
    works : one for each buffer
    """
    pixels = width * height
    words = {"tile_counters": tiles} if tiles else {"fragments": pixels * FRAGMENT_BYTES // 4, "depth": pixels}
    works = (
        thread_per_item("clear", f"clear_{buffer}", -(-count // 4), BLOCK, simt, stores=(Access(buffer, 16, 1, 16),))
        for buffer, count in {**words, "colors": 3 * pixels}.items()
    )
    return StageResult(None, tuple(works))
