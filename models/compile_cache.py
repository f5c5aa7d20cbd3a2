"""Where compiled kernels are kept: one folder for each version of Numba and each setting that changes what it makes."""

import contextlib
import importlib.metadata
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

STALE_DAYS = 14  # what was not loaded for so long is removed
_FLAGS = ("NUMBA_BOUNDSCHECK", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT")
_PRUNED = "pruned"  # a file whose age says when stale kernels were last removed
_listeners: list[Callable[[str], None]] = []
_starts: list[Callable[[], None]] = []
_compiling: list[str] = []  # a kernel, and those that it waits for


def cache_folder() -> Path:
    """Folder of compiled kernels: named in NUMBA_CACHE_DIR, or of the user's caches; a temporary one if that fails."""
    return _folder(os.environ.get("NUMBA_CACHE_DIR", ""), tuple(os.environ.get(flag, "") for flag in _FLAGS))


@cache
def _folder(named: str, flags: tuple[str, ...]) -> Path:
    key = "-".join(filter(None, ("numba", importlib.metadata.version("numba"), *flags)))
    folder = (Path(named) if named else _user_cache() / "tilestamp") / key
    if not _make_writable(folder):
        folder = Path(tempfile.gettempdir()) / f"tilestamp-{_user_id()}" / key
        _make_writable(folder)
    _prune(folder)
    return folder


def on_compiling(listener: Callable[[str], None] | None) -> None:
    """Tell ``listener``, and no other, what is now being compiled, as ``module.kernel``; ``""`` when nothing is."""
    _listeners[:] = [listener] if listener else []


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C through that is heard in a callback of LLVM, where Python drops it and the compiler stumbles later."""
    heard: list[bool] = []
    usual = sys.unraisablehook

    def hook(dropped: "sys.UnraisableHookArgs") -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            heard.append(True)
        else:
            usual(dropped)

    sys.unraisablehook = hook
    try:
        yield
    except Exception:
        if heard:
            raise KeyboardInterrupt from None
        raise
    finally:
        sys.unraisablehook = usual
    if heard:
        raise KeyboardInterrupt


def before_compiling(start: Callable[[], None] | None) -> None:
    """Call ``start`` once, and no other, when the next kernel is missing that Python calls."""
    _starts[:] = [start] if start else []


def note_missing() -> None:
    """Say that a kernel is missing that Python calls."""
    while _starts:
        _starts.pop()()


def note_compiling(function: Callable[..., Any]) -> None:
    """Say that a kernel is about to be compiled."""
    _compiling.append(f"{function.__module__.rpartition('.')[2]}.{function.__name__.lstrip('_')}")
    _tell()


def note_compiled() -> None:
    """Say that the kernel is compiled which was last begun."""
    del _compiling[-1:]
    _tell()


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Forget in the end what was begun and failed."""
    before = len(_compiling)
    try:
        yield
    finally:
        if len(_compiling) > before:
            del _compiling[before:]
            _tell()


def _tell() -> None:
    for listener in _listeners:
        listener(_compiling[-1] if _compiling else "")


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
    except OSError:
        return False
    return True


def _prune(folder: Path) -> None:
    """Once a day, remove the kernels that were not loaded for a while, and what a killed process left of one."""
    mark, now = folder / _PRUNED, time.time()
    with contextlib.suppress(OSError):
        if mark.exists() and now - mark.stat().st_mtime < 86400:
            return
        mark.touch()
        for file in folder.glob("*.*"):
            if now - file.stat().st_mtime > STALE_DAYS * 86400:
                file.unlink()
