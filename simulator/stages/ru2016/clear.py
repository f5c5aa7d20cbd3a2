"""Clears before each frame (Ru 2016): the fragment buffer, the depth buffer and, with tiles, the list counters."""

from models.simt import Simt
from simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from simulator.stages.thread_per_item import Access, thread_per_item
from simulator.work import Work

BLOCK = 256  # threads of the runtime's memset (assumed)


def clear(width: int, height: int, tiles: int, simt: Simt) -> list[Work]:
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
    list of Work
        One for each buffer.
    """
    pixels = width * height
    words = pixels * FRAGMENT_BYTES // 4
    works = [
        thread_per_item("clear", "clear_fragments", words, BLOCK, simt, stores=(Access("fragments", 4, 1),)),
        thread_per_item("clear", "clear_depth", pixels, BLOCK, simt, stores=(Access("depth", 4, 1),)),
    ]
    if tiles:
        counters = (Access("tile_counters", 4, 1),)
        works.append(thread_per_item("clear", "clear_counters", tiles, BLOCK, simt, stores=counters))
    return works
