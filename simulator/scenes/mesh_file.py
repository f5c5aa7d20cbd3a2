"""Meshes from files: each kind by its reader, and what else trimesh reads."""

from pathlib import Path
from typing import Any

import numpy as np

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_file
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.gltf_mesh import read_gltf
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.off_file import read_off
from tilestamp.simulator.scenes.ply_file import read_ply
from tilestamp.simulator.scenes.polygons import Polygons
from tilestamp.simulator.scenes.stl_file import read_stl

READERS = {".ply": read_ply, ".off": read_off, ".stl": read_stl, ".glb": read_gltf, ".gltf": read_gltf}
EXTRA = "tilestamp[formats]"


def read_mesh(path: str | Path, notes: Notes | None = None) -> Mesh:
    """Read the triangles of any file but OBJ: PLY, OFF, STL and glTF by our readers, all else by trimesh.

    Parameters
    ----------
    path : str or Path
    notes : Notes, optional
        Gets a sentence for all that was skipped, guessed or could not be represented.

    Raises
    ------
    TilestampError
        Where the file cannot be read, has no triangles, or holds NaN or vertex numbers that do not exist.
    """
    path, notes = Path(path), Notes() if notes is None else notes
    if not is_file(path):
        raise TilestampError(f"{path}: there is no such file")
    return READERS.get(path.suffix.lower(), _read_foreign)(path, notes)


def _read_foreign(path: Path, notes: Notes) -> Mesh:
    """Read a file by trimesh: positions and triangles of all parts, placed by their nodes."""
    import trimesh

    try:
        loaded = trimesh.load_scene(path, process=False).to_mesh()
        positions, triangles = np.asarray(loaded.vertices, np.float64), np.asarray(loaded.faces, np.int64)
        colors: Any = loaded.visual.to_color()
        colors = None if colors.kind is None else np.asarray(colors.vertex_colors) / 255.0
    except ImportError as error:
        what = f"reading {path.suffix} files needs a module ({error}): install {EXTRA}, or it where that has it not"
        raise TilestampError(f"{path}: {what}") from None
    except Exception as error:  # noqa: BLE001 (whatever a reader of broken bytes raises, the file is to blame)
        raise TilestampError(f"{path}: cannot be read as a mesh ({type(error).__name__}: {error})") from None
    notes.add(f"{path.suffix} files are read by trimesh: triangles and colours, no textures")
    return Polygons(positions, triangles.reshape(-1), np.full(len(triangles), 3), colors).mesh(path)
