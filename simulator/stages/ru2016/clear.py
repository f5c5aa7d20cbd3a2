"""Clears of each frame (Ru 2016): with tiles the list counters, else fragments and depth; colours before shading.

Depth has a kernel of his own, a thread a pixel in blocks of 64; the others are the runtime's memset. A tile writes
every fragment and depth of its pixels, so the tiled path has nothing else to clear.
"""

from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.work import Work

BLOCK = 256  # threads of the runtime's memset, four words each (assumed)
DEPTH_BLOCK = 64


def clear(width: int, height: int, tiles: int, simt: Simt) -> StageResult[None]:
    """Set the buffers that rasters write to their start values.

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
    sizes = {"tile_counters": tiles} if tiles else {"fragments": pixels * FRAGMENT_BYTES // 4}
    works = [memset(buffer, count, simt) for buffer, count in sizes.items()]
    if not tiles:
        depth = (Access("depth", 4, 1),)
        works.append(thread_per_item("clear", "clear_depth", pixels, DEPTH_BLOCK, simt, stores=depth))
    return StageResult(None, tuple(works))


def memset(buffer: str, words: int, simt: Simt) -> Work:
    """Count the runtime's memset of a buffer of 4-byte words."""
    return thread_per_item("clear", f"clear_{buffer}", -(-words // 4), BLOCK, simt, stores=(Access(buffer, 16, 1, 16),))
