"""Where compiled kernels are kept, and for how long."""

import os
import time
from pathlib import Path

from tilestamp.models import compile_cache


def test_bounds_checking_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_BOUNDSCHECK", raising=False)
    plain = compile_cache.cache_folder()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert compile_cache.cache_folder() != plain


def test_a_folder_named_by_the_user_is_used(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert compile_cache.cache_folder().parent == tmp_path


def test_a_cache_that_cannot_be_written_falls_back_to_temporary_files(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    folder = compile_cache.cache_folder()
    assert folder.is_dir()
    assert blocked not in folder.parents


def test_kernels_that_were_not_loaded_for_long_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "first"))
    folder = tmp_path / "second" / compile_cache.cache_folder().name
    folder.mkdir(parents=True)
    for name in ("old.nbc", "older_version.nbi", "unfinished.4711", "recent.nbc"):
        (folder / name).touch()
    past = time.time() - 2 * compile_cache.STALE_DAYS * 86400
    for name in ("old.nbc", "older_version.nbi", "unfinished.4711"):
        os.utime(folder / name, (past, past))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "second"))
    compile_cache.cache_folder()
    assert {path.name for path in Path(folder).glob("*.*")} == {"recent.nbc"}
