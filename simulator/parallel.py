"""Threads over parts of a kernel's work: the kernel is compiled once, without ``parallel=True``.

A worker is ``@kernel`` and takes ``(part, parts, *args)``; it works on its share, for example the
blocks ``part * blocks // parts`` to ``(part + 1) * blocks // parts``. Parts write to different places, or to private
rows that are added up as integers, so that neither the number of threads nor their order changes a result. Numba's own
``prange`` does the same, but each such kernel costs seconds to compile, and Ctrl-C waits for the end of it.
"""

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import Any

from numba import config, get_num_threads

PARTS = 8  # a thread: even loads, and Ctrl-C is heard between parts


def parts_of(items: int, smallest: int = 1) -> int:
    """How many parts to cut ``items`` into, of ``smallest`` items at least."""
    return max(1, min(items // smallest, PARTS * int(get_num_threads())))


def for_parts(worker: Callable[..., Any], parts: int, *args: Any) -> list[Any]:
    """Call ``worker(part, parts, *args)`` for each part, on as many threads as Numba would use.

    Parameters
    ----------
    worker : callable
        Releases the GIL.
    parts : int
    *args
        As the worker takes them.

    Returns
    -------
    list
        What the worker returned for each part.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C: parts that have begun are finished, no other begins.
    """
    left = deque(range(parts))
    results: list[Any] = [None] * parts

    def work() -> None:
        while left:
            try:
                part = left.popleft()
            except IndexError:  # another thread was faster
                return
            results[part] = worker(part, parts, *args)

    helpers = [_pool().submit(work) for _ in range(min(parts, get_num_threads()) - 1)]
    try:
        work()
    finally:
        left.clear()
        wait(helpers)
    for helper in helpers:
        helper.result()  # raises what it raised
    return results


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(config.NUMBA_NUM_THREADS, "tilestamp")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has none of the threads
