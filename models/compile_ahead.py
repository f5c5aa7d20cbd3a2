"""Kernels compiled ahead by other processes, from the last that a run needs, while it compiles from the first.

What it will need nobody lists: the others rehearse the run on a tiny input, with every kernel interpreted, and note
which Python calls with what types. They share nothing but the folder of compiled kernels. They end with their parent,
print nothing, and what they cannot do is left to it.
"""

import atexit
import contextlib
import os
import pickle
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

from numba import get_num_threads

from tilestamp.models.compile_cache import before_compiling, cache_folder
from tilestamp.models.kernel import interpreted

MOST = 3  # processes: the kernels of a run are about 15, of which one takes a fifth of the time
_helpers: list[subprocess.Popen[bytes]] = []


def compile_ahead(rehearse: Callable[..., object], *arguments: Any) -> None:
    """Have the kernels compiled ahead which ``rehearse(*arguments)`` calls, from the next on that is not on disk."""
    before_compiling(partial(_start, rehearse, arguments))


def _start(rehearse: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    """Start as many processes as there are other cores for, unless some are at work."""
    count = min(MOST, get_num_threads() - 1)
    if count < 1 or not os.access(cache_folder(), os.W_OK) or any(helper.poll() is None for helper in _helpers):
        return
    with contextlib.suppress(Exception):  # what cannot be pickled is not rehearsed
        request = pickle.dumps((rehearse, arguments))
        _helpers[:] = [_started(request) for _ in range(count)]
        atexit.register(_stop)


def _started(request: bytes) -> "subprocess.Popen[bytes]":
    """Start one, which imports from where this process does; that its input ends tells it that its parent has."""
    command = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import main; main()"
    silent = subprocess.DEVNULL
    helper = subprocess.Popen(  # noqa: S603 - our own
        [sys.executable, "-c", command], stdin=subprocess.PIPE, stdout=silent, stderr=silent, start_new_session=True
    )
    assert helper.stdin  # noqa: S101 - for mypy
    helper.stdin.write(len(request).to_bytes(8) + request)
    helper.stdin.flush()
    return helper


def _stop() -> None:
    for helper in _helpers:
        helper.kill()
        helper.wait()
    _helpers.clear()


def main() -> None:
    """Rehearse, and compile from the end what nobody compiles yet."""
    rehearse, arguments = pickle.loads(sys.stdin.buffer.read(int.from_bytes(sys.stdin.buffer.read(8))))  # noqa: S301 - our own
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warnings.simplefilter("ignore")
    with interpreted() as calls, contextlib.suppress(Exception):
        rehearse(*arguments)
    before_compiling(None)  # what is rehearsed would have others start
    for kernel, types in reversed(calls):
        with contextlib.suppress(Exception):
            if kernel.claim(types):
                kernel.compile(types)


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)
