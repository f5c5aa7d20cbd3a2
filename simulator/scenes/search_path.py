"""Where scenes are looked for: a setting, and the environment variable TILESTAMP_SCENES."""

import os
from collections.abc import Iterable
from functools import cache
from hashlib import file_digest as digest_of_file
from pathlib import Path

from tilestamp.models.errors import MissingInputError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.models.paths import is_file
from tilestamp.models.used import note

SCENES_VARIABLE = "TILESTAMP_SCENES"  # folders, joined as in PATH
FILES = "scene files"  # under which a manifest names the files that were looked for, each with its digest
MISSING = "missing"
DIGITS = 16  # hexadecimal, of a digest
LEVELS = 2  # of sub-folders that are looked into
# Where files of one stem differ in kind, the first of these wins: the paper's patches before a cage before triangles.
SUFFIXES = (".bpt", ".obj", ".ply", ".glb", ".gltf", ".off", ".stl", ".npz", ".sog")
FOLDER_MARK = "meta.json"  # of a folder that is a scene
COMPRESSED = ".compressed"  # before .ply

SearchPath = str | Path | Iterable[str | Path] | None


def scene_folders(scene_path: SearchPath = None) -> list[Path]:
    """Give the folders of the search path: the setting's first, then those of the environment."""
    if scene_path is None:
        scene_path = ()
    elif isinstance(scene_path, (str, Path)):
        scene_path = str(scene_path).split(os.pathsep)
    places = [*scene_path, *os.environ.get(SCENES_VARIABLE, "").split(os.pathsep)]
    return [Path(place) for place in places if str(place)]


def scene_files(scene_path: SearchPath = None) -> list[Path]:
    """List the files of the search path that can be scenes: folder by folder, preferred kinds first, then by name."""
    found: dict[Path, None] = {}
    for folder in scene_folders(scene_path):
        files = [path for level in range(LEVELS + 1) for path in sorted(folder.glob("*/" * level + "*"))]
        for suffix in SUFFIXES:
            found.update(dict.fromkeys(path for path in files if path.suffix.lower() == suffix and path.is_file()))
        found.update(dict.fromkeys(path for path in files if is_file(path / FOLDER_MARK)))
    return list(found)


def scene_name(path: Path) -> str:
    """Name of the scene in a file: its stem; of a folder of levels of detail the folder above, too (``playbot/2``)."""
    if path.name == FOLDER_MARK:
        path = path.parent
    if not path.suffix:
        return f"{path.parent.name}/{path.name}" if path.name.isdecimal() else path.name
    return path.stem.removesuffix(COMPRESSED)


def find_scene(name: str, scene_path: SearchPath = None) -> Path | None:
    """Find a file by its stem or its whole name on the search path, or None; either is noted for manifests."""
    path = next((path for path in scene_files(scene_path) if name in (path.stem, path.name, scene_name(path))), None)
    note(FILES, name, file_digest(path))
    return path


def file_digest(path: Path | None) -> str:
    """Digest of a file's bytes, 16 hexadecimal digits; ``missing`` where there is none."""
    if path is None:
        return MISSING
    about = path.stat()
    return _digest(path, about.st_size, about.st_mtime_ns)


@cache
def _digest(path: Path, _size: int, _modified: int) -> str:
    path = path / FOLDER_MARK if path.is_dir() else path
    with path.open("rb") as file:
        return digest_of_file(file, "sha256").hexdigest()[:DIGITS]


def missing_scene(name: str, known: Iterable[str], scene_path: SearchPath = None) -> MissingInputError:
    """Say that a scene is missing and where its file goes."""
    folders = ", ".join(map(str, scene_folders(scene_path)))
    where = f"one of the folders {folders}" if folders else "a folder, and name that folder"
    setting = "" if folders else f" in {SCENES_VARIABLE} (or the setting scene_path)"
    file = name if Path(name).suffix.lower() in SUFFIXES else f"{name}.bpt, .obj, .ply, .glb or .npz"
    names = list(known)
    return MissingInputError(
        f"scene {name!r}{did_you_mean(name, names)} is neither a file nor known here ({', '.join(names)}):"
        f" put {file} into {where}{setting}"
    )
