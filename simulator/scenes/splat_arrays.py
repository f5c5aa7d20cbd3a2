"""Splats from .npz files: the arrays of ``Splats`` as the rasterizer takes them, which nothing converts."""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.splats import Splats, make_splats

NAMES = ("means", "scales", "rotations", "opacities", "colours")
OTHERWISE = {"colors": "colours"}  # spelled


def has_splat_arrays(path: Path) -> bool:
    """Whether a .npz file has splats."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return {"means", "scales"} <= set(arrays)
    except (OSError, ValueError, BadZipFile):
        return False


def read_splat_arrays(path: Path, notes: Notes) -> Splats:
    """Read ``means, scales, rotations, opacities, colours`` and, if there, ``harmonics``; raises TilestampError."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {OTHERWISE.get(name, name): file[name] for name in file}
    missing = [name for name in NAMES if name not in arrays]
    if missing:
        raise TilestampError(f"{path}: has splats without {', '.join(missing)}")
    harmonics = arrays.pop("harmonics", None)
    unread = ", ".join(name for name in arrays if name not in NAMES)
    notes.add_if(unread, f"arrays that are not read: {unread}")
    means, scales, rotations, opacities, colours = (arrays[name] for name in NAMES)
    return make_splats(means, scales, rotations, opacities, colours, harmonics)
