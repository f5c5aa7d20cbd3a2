"""Grids of the scenes that were measured on an H200, through our own front end."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice


@cache
def diced(shared: Path, name: str) -> tuple[Grids, dict[str, Any]]:
    """Grids of a scene, and its camera."""
    camera = json.loads((shared / "silicon" / "micropolygon_cameras.json").read_text())[name]
    patches = load_scene(camera["model"]).patches
    assert patches is not None
    view = (camera["model_to_clip"], camera["width"], camera["height"])
    subpatches, _, _ = bound_and_split(patches.points, *view, camera["bound_pixels"], Simt(), counting=False)
    grids, _, _ = dice(patches.points, subpatches, *view, Simt(), counting=False)
    return grids, camera
