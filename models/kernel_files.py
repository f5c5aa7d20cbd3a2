"""Files of compiled kernels, one a kernel and signature, which processes write and wait for side by side.

Numba numbers the files of a kernel and keeps an index of them: two processes that compile it for different types at the
same time may write one number twice, and one is loaded for the other. Here the name says the types.
"""

import contextlib
import hashlib
import os
import pickle
import time
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.serialize import dumps

try:
    import fcntl
except ImportError:  # Windows: whoever needs a kernel compiles it
    fcntl = None  # type: ignore[assignment]

PATIENCE = 60.0  # seconds, after which a process that is compiling counts as stopped
_claimed: list[tuple[int, int]] = []  # file and place of the locks of what is being compiled


class KernelFiles:
    """What was compiled of one kernel.

    Parameters
    ----------
    folder : str
    name : str
        Of the kernel and all that it depends on.
    """

    def __init__(self, folder: str, name: str) -> None:
        self._folder = Path(folder)
        self._name = name

    def path(self, key: object) -> Path:
        """File for what ``key`` says in letters: types, options, processor."""
        return self._folder / f"{self._name}-{hashlib.sha256(str(key).encode()).hexdigest()[:16]}.nbc"

    def load(self, key: object) -> Any:
        """Read what was compiled, None if it was not."""
        path = self.path(key)
        try:
            kept = path.read_bytes()
        except FileNotFoundError:
            return None
        os.utime(path)  # the mark by which pruning sees that it is in use
        return pickle.loads(kept)  # noqa: S301 - our own

    def save(self, key: object, compiled: object) -> None:
        """Write what was compiled, whole or not at all."""
        path = self.path(key)
        unfinished = path.with_suffix(f".{os.getpid()}")
        try:
            unfinished.write_bytes(dumps(compiled))
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)

    def flush(self) -> None:
        """Forget what was compiled."""
        for path in self._folder.glob(f"{self._name}-*.nbc"):
            path.unlink()

    def claim(self, key: object, patience: float = PATIENCE) -> bool:
        """Tell other processes that this one compiles it now, after one that does so already; say if none is left."""
        if fcntl is None:
            return True
        place = int.from_bytes(hashlib.sha256(self.path(key).name.encode()).digest()[:4])
        end = time.monotonic() + patience
        with contextlib.suppress(OSError):  # of a file system without locks
            file = _locks(self._folder)
            while not _lock(file, place):
                if time.monotonic() > end:
                    return False
                time.sleep(0.02)
            _claimed.append((file, place))
        return True


def release() -> None:
    """Let others have what was claimed: it is compiled, or cannot be."""
    while _claimed:
        file, place = _claimed.pop()
        with contextlib.suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, place)


def _lock(file: int, place: int) -> bool:
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except BlockingIOError:
        return False
    except PermissionError:  # POSIX allows either
        return False
    return True


@cache
def _locks(folder: Path) -> int:
    """A file that is locked in places, one a kernel; it stays open, for to close it gives all locks up."""
    return os.open(folder / "locks", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
