"""What compilers make of Ru's kernels: memory instructions, where the source copies structures, and threads that fit.

His source copies a fragment of 56 bytes and writes a pixel of the window byte by byte. The compiler of 2016 for
compute capability 3.x is taken to have done it word by word; nvcc 13 for 9.0 joins words that lie side by side where
it knows their alignment (machine code, and the sectors that an H200 counts). The rule of coalescing tells them apart.
"""

from typing import NamedTuple

from tilestamp.models.simt import Coalescing, Simt


class Words(NamedTuple):
    """Memory instructions of a warp, and threads that an SM holds as their registers allow.

    Parameters
    ----------
    fragment : tuple of int
        Bytes of each store of a fragment.
    window : tuple of int
        Bytes of each store of a pixel of the window.
    nearer : int
        Loads of the attributes of a triangle that is nearer.
    raster_threads, list_threads : int
        Of the rasters (63 registers published for 3.x, 44 on 9.0), and of the list kernel (40 on 9.0).
    """

    fragment: tuple[int, ...]
    window: tuple[int, ...]
    nearer: int
    raster_threads: int
    list_threads: int


OLD = Words(fragment=(4,) * 11 + (8,), window=(1,) * 4, nearer=27, raster_threads=1024, list_threads=1024)
NEW = Words(fragment=(8,) * 7, window=(4,), nearer=26, raster_threads=1280, list_threads=1536)


def words(simt: Simt) -> Words:
    """Memory instructions of the compiler for such a machine."""
    return NEW if simt.coalescing == Coalescing.WARP_SECTORS else OLD
