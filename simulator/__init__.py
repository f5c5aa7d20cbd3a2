"""Rasterizers: scenes, stages, pipelines. They make the picture and one launch for each kernel.

``run = simulate("teapot", pipeline="micropolygon", machine="gtx280", width=1600, height=1200)``. What is named here is
loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import models  # noqa: F401 - sets the compile cache up before any kernel is imported

if TYPE_CHECKING:
    from simulator.run import Run
    from simulator.scenes import LookAt, ModelToClip, Scene, list_scenes, load_scene
    from simulator.simulation import simulate

_HOMES = {
    "LookAt": "scenes",
    "ModelToClip": "scenes",
    "Run": "run",
    "Scene": "scenes",
    "list_scenes": "scenes",
    "load_scene": "scenes",
    "simulate": "simulation",
}

__all__ = ["LookAt", "ModelToClip", "Run", "Scene", "list_scenes", "load_scene", "simulate"]


def __getattr__(name: str) -> Any:
    """Load a public name from the module where it lives."""
    if name in _HOMES:
        return getattr(import_module(f"simulator.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'simulator' has no attribute {name!r}")
