"""Where compiled kernels are kept: one folder for each state of the sources.

Numba's disk cache looks only at the file of the kernel itself: it goes stale when a helper in another file
changes, freezes module constants, and ignores the bounds-check flag. So the folder is named after everything
that a compiled kernel depends on (the version, the flags, the processor, and a digest of all our sources),
and it is chosen before any kernel is imported. A folder that the user names in NUMBA_CACHE_DIR is left alone.
"""

import contextlib
import hashlib
import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

PACKAGES = ("models", "simulator")  # the packages that hold kernels
STALE_DAYS = 14  # folders of other sources that nobody has opened for so long are removed
_OURS = "TILESTAMP_COMPILE_CACHE"  # the folder that we chose: a child process with other flags chooses again
_FLAGS = ("NUMBA_BOUNDSCHECK", "NUMBA_DISABLE_JIT", "NUMBA_CPU_NAME")


@cache
def source_digest() -> str:
    """Digest of the Python sources of ``models`` and ``simulator``: 16 hexadecimal digits, also used in manifests."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder in which Numba keeps compiled kernels."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    return Path(named) if named else _user_cache() / "tilestamp" / _key()


def _named_by_user() -> bool:
    named = os.environ.get("NUMBA_CACHE_DIR")
    return bool(named) and named != os.environ.get(_OURS)


def is_cold() -> bool:
    """Whether no kernel has been compiled into the cache folder yet: the first run will take its time."""
    return next(cache_folder().rglob("*.nbi"), None) is None


def set_up() -> Path:
    """Point Numba at the cache folder; call it before any kernel is imported.

    Returns
    -------
    Path
        The folder, made where it did not exist; a folder for temporary files where the cache cannot be written.
    """
    if _named_by_user():
        return cache_folder()
    folder = _user_cache() / "tilestamp" / _key()
    if not _make_writable(folder):
        folder = Path(tempfile.gettempdir()) / f"tilestamp-{_user_id()}" / _key()
        _make_writable(folder)
    _prune(folder)
    os.environ["NUMBA_CACHE_DIR"] = os.environ[_OURS] = str(folder)
    if "numba" in sys.modules:  # it read its settings when it was imported
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    return folder


def _key() -> str:
    flags = "".join("1" if os.environ.get(flag, "0") not in {"", "0"} else "0" for flag in _FLAGS[:2])
    processor = os.environ.get(_FLAGS[2]) or platform.machine() or "cpu"
    return f"{importlib.metadata.version('numba')}-{flags}{processor}-{source_digest()}"


def _user_cache() -> Path:
    """Folder for caches by the custom of the operating system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _user_id() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def _make_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        os.utime(folder)  # the mark by which pruning sees that it is in use
    except OSError:
        return False
    return True


def _prune(current: Path) -> None:
    """Remove the folders of other sources that have not been opened for a while."""
    with contextlib.suppress(OSError):
        for folder in current.parent.iterdir():
            if folder != current and folder.is_dir() and time.time() - folder.stat().st_mtime > STALE_DAYS * 86400:
                shutil.rmtree(folder, ignore_errors=True)
