"""Compiled kernels live in a folder named after everything that they depend on."""

import os
import subprocess
import sys
import time
from pathlib import Path

from models import compile_cache


def _folder_of_new_process(**environment):
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "TILESTAMP_"))}
    code = "import models, numba; print(numba.config.CACHE_DIR)"
    root = Path(compile_cache.__file__).parent.parent
    done = subprocess.run(  # noqa: S603 - our own interpreter, our own code
        [sys.executable, "-c", code], env=clean | environment, cwd=root, capture_output=True, text=True, check=True
    )
    return Path(done.stdout.strip())


def test_the_folder_names_the_digest_of_the_sources(tmp_path):
    assert compile_cache.source_digest() in _folder_of_new_process(XDG_CACHE_HOME=str(tmp_path)).name


def test_bounds_checking_has_a_folder_of_its_own(tmp_path):
    plain = _folder_of_new_process(XDG_CACHE_HOME=str(tmp_path))
    checked = _folder_of_new_process(XDG_CACHE_HOME=str(tmp_path), NUMBA_BOUNDSCHECK="1")
    assert plain != checked


def test_a_child_process_with_other_flags_does_not_inherit_the_folder(tmp_path):
    plain = _folder_of_new_process(XDG_CACHE_HOME=str(tmp_path))
    inherited = {"NUMBA_CACHE_DIR": str(plain), "TILESTAMP_COMPILE_CACHE": str(plain), "NUMBA_BOUNDSCHECK": "1"}
    assert _folder_of_new_process(XDG_CACHE_HOME=str(tmp_path), **inherited) != plain


def test_a_folder_named_by_the_user_is_left_alone(tmp_path):
    assert _folder_of_new_process(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path


def test_a_cache_that_cannot_be_written_falls_back_to_temporary_files(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    folder = _folder_of_new_process(XDG_CACHE_HOME=str(blocked), TMPDIR=str(tmp_path))
    assert folder.is_dir()
    assert blocked not in folder.parents


def test_a_new_folder_is_cold_until_a_kernel_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert compile_cache.is_cold()
    (tmp_path / "kernel.nbi").touch()
    assert not compile_cache.is_cold()


def test_old_folders_of_other_sources_are_removed(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compile_cache, "_user_cache", lambda: tmp_path)
    old, recent = tmp_path / "tilestamp" / "old", tmp_path / "tilestamp" / "recent"
    for folder in (old, recent):
        folder.mkdir(parents=True)
    past = time.time() - 2 * compile_cache.STALE_DAYS * 86400
    os.utime(old, (past, past))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    compile_cache.set_up()
    assert not old.exists()
    assert recent.exists()
