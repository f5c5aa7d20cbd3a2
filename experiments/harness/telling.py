"""How far something is, in words; workers tell it to the process that started them, through a local socket."""

import os
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from tempfile import TemporaryDirectory
from threading import Thread

from tilestamp.models.compile_cache import on_compiling

LONGEST = 4096  # bytes of a line


@contextmanager
def listening(say: Callable[[str], None]) -> Iterator[str]:
    """Pass on what workers tell an address, from another thread."""
    with TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        address = f"{folder}/progress"
        receiver.bind(address)
        lines = map(bytes.decode, iter(partial(receiver.recv, LONGEST), b""))
        thread = Thread(target=deque, args=(map(say, lines), 0), daemon=True)  # a deque without room: says them all
        thread.start()
        try:
            yield address
        finally:
            tell(address, "")
            thread.join()


def tell(address: str, text: str) -> None:
    """Say what is being done; where nobody listens any more, the parent is gone, and so are we."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.sendto(text.encode()[:LONGEST], address)
    except OSError:
        os._exit(1)


def tell_compiling(address: str, about: str) -> None:
    """Say from now on what is being compiled in this process, and for what."""
    on_compiling(lambda kernel: tell(address, f"{about}: compiling {kernel} (first run only)" if kernel else about))


def so_far(done: int, total: int, seconds: float, what: str = "") -> str:
    """Say how many are done of how many, and how long the others take at that rate: ``3 of 29, about 2 min left``."""
    counted = f"{done:,} of {total:,}{what}"
    return f"{counted}, about {duration(seconds / done * (total - done))} left" if 0 < done < total else counted


def duration(seconds: float) -> str:
    """Say a time: ``3 s``, ``5 min``, ``12 h``, ``40 days``."""
    for unit, size in (("days", 172800.0), ("h", 7200.0), ("min", 120.0)):
        if seconds >= size:
            return f"{seconds / {'days': 86400.0, 'h': 3600.0, 'min': 60.0}[unit]:,.0f} {unit}"
    return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
