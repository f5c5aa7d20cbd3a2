"""Whether a stored result is still what a run would give: its manifest against what lies here now.

It is, where these are the same:

- the code: every file of ``models`` and ``simulator`` (machines, mixes, scenes and kernels among them), and of
  ``experiments`` and ``reports`` those that the experiment's module and the writing of results reach by imports, with
  the data beside them (published tables, measurements). An edit of another experiment, of the command line or of the
  page makes nothing invalid; an edit of a comment in the simulator makes everything so: better twice than wrong;
- Python and the packages that compute or draw, by version;
- the environment variables ``TILESTAMP_...``, but for where scenes are: the files that were looked for are compared
  instead, by their digests, and so is that a file was missing. What lies in another folder that a variable names
  (``TILESTAMP_TEXTURED``) is not looked at.

An experiment that was not run, for an input that it lacks, has no valid result.
"""

import hashlib
import json
import os
import platform
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tilestamp.experiments.harness.record import FORMAT, NOT_RUN
from tilestamp.experiments.harness.registry import folder_name
from tilestamp.experiments.harness.sources import ROOT, reached
from tilestamp.simulator.manifest import DIGITS, PACKAGES
from tilestamp.simulator.scenes.search_path import FILES, MISSING, SCENES_VARIABLE, file_digest, find_scene

FLOORS = ("models", "simulator")
ALWAYS = ("tilestamp.experiments.harness.write", "tilestamp.experiments.harness.fit")  # these make every result
COMPILED = {".pyc", ".nbi", ".nbc"}
REASONS = {"code": "the code has changed", "versions": "other versions of {}", "variables": "{} has another value"}


def made_from(experiment: str) -> dict[str, Any]:
    """What decides a result now, but for its scenes."""
    variables = {name: value for name, value in os.environ.items() if name.startswith("TILESTAMP_")}
    variables.pop(SCENES_VARIABLE, None)
    return {
        "code": code_digest(experiment),
        "versions": _versions(),
        "variables": dict(sorted(variables.items())),
    }


@cache
def _versions() -> dict[str, str]:
    return {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}


@cache
def code_digest(experiment: str) -> str:
    """Digest of the files that decide what an experiment gives, 16 hexadecimal digits."""
    digest = hashlib.sha256(_floors().encode())
    for path in sorted(decisive(experiment)):
        digest.update(_of_file(path))
    return digest.hexdigest()[:DIGITS]


def decisive(experiment: str) -> set[Path]:
    """Modules above the simulator that an experiment reaches, and the data beside those of the experiments.

    What lies beside the modules of ``reports`` are pictures and, by default, the results themselves.
    """
    module = f"tilestamp.experiments.{experiment.replace('/', '.')}"
    files = {path for path in reached(module, *ALWAYS) if path.relative_to(ROOT).parts[0] not in FLOORS}
    folders = {file.parent for file in files if file.relative_to(ROOT).parts[0] == "experiments"}
    return files | {path for folder in folders for path in _data(folder)}


@cache
def _floors() -> str:
    """Digest of all files of the lower floors."""
    paths = sorted(path for floor in FLOORS for path in _files(ROOT / floor))
    return hashlib.sha256(b"".join(map(_of_file, paths))).hexdigest()


@cache
def _data(folder: Path) -> list[Path]:
    """Files beside modules that are none, in the folders of their experiments."""
    return [path for path in _files(folder) if path.suffix != ".py"]


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file() and path.suffix not in COMPILED)


@cache
def _of_file(path: Path) -> bytes:
    return hashlib.sha256(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes()).digest()


def outdated(output: Path, experiment: str) -> str:
    """Why the result of an experiment in ``output`` is not valid any more; nothing where it is."""
    try:
        folder = output / folder_name(experiment)
        manifest = json.loads((folder / "manifest.json").read_text("utf-8"))
        record = json.loads((folder / "result.json").read_text("utf-8"))
    except (OSError, ValueError):
        return "there is no result yet"
    if record.get("format") != FORMAT:
        return "another version of tilestamp wrote it"
    if record["state"] == NOT_RUN:
        return "it lacked an input"
    return _changed(manifest.get("made from", {}), made_from(experiment)) or _moved(manifest.get(FILES, {}))


def _changed(before: dict[str, Any], now: dict[str, Any]) -> str:
    """The first thing that is another one now."""
    for key, reason in REASONS.items():
        old, new = before.get(key), now[key]
        if old != new:
            return reason.format(_first_difference(old, new))
    return ""


def _first_difference(old: object, new: object) -> str:
    if not isinstance(old, dict) or not isinstance(new, dict):
        return ""
    return next((key for key in sorted(old.keys() | new.keys()) if old.get(key) != new.get(key)), "")


def _moved(files: dict[str, str]) -> str:
    """The first scene whose file is another one now, or has come, or is gone."""
    for name, digest in files.items():
        now = file_digest(find_scene(name))
        if now != digest:
            what = "here now" if digest == MISSING else "missing" if now == MISSING else "another one"
            return f"the scene {name} is {what}"
    return ""
