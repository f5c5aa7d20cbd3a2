"""tilestamp: the reference simulator for rasterizers written in software for GPUs.

``run = tilestamp.simulate("teapot", pipeline="micropolygon", machine="gtx280", width=1600, height=1200)``. What is
named here is what a user needs, loaded when it is first used. The four floors are the subpackages ``models``,
``simulator``, ``experiments`` and ``reports``.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tilestamp.experiments.studies.study import Study
    from tilestamp.experiments.studies.study_file import read_study
    from tilestamp.models.errors import TilestampError
    from tilestamp.models.machine import Machine, altered, list_machines, load_machine
    from tilestamp.models.variants import variants
    from tilestamp.simulator.prices import Prices
    from tilestamp.simulator.run import Run
    from tilestamp.simulator.scenes import LookAt, ModelToClip, Scene, list_scenes, load_scene
    from tilestamp.simulator.simulation import simulate

__version__ = "0.2.0"

_HOMES = {
    "LookAt": "simulator.scenes",
    "Machine": "models.machine",
    "ModelToClip": "simulator.scenes",
    "Prices": "simulator.prices",
    "Run": "simulator.run",
    "Scene": "simulator.scenes",
    "Study": "experiments.studies.study",
    "TilestampError": "models.errors",
    "altered": "models.machine",
    "list_machines": "models.machine",
    "list_scenes": "simulator.scenes",
    "load_machine": "models.machine",
    "load_scene": "simulator.scenes",
    "read_study": "experiments.studies.study_file",
    "simulate": "simulator.simulation",
    "variants": "models.variants",
}

__all__ = [
    "LookAt",
    "Machine",
    "ModelToClip",
    "Prices",
    "Run",
    "Scene",
    "Study",
    "TilestampError",
    "altered",
    "list_machines",
    "list_scenes",
    "load_machine",
    "load_scene",
    "read_study",
    "simulate",
    "variants",
]


def __getattr__(name: str) -> Any:
    """Load a public name from the module where it lives."""
    if name in _HOMES:
        return getattr(importlib.import_module(f"tilestamp.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'tilestamp' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List what a user needs, and nothing else."""
    return [*__all__, "__version__"]
