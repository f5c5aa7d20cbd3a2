"""The SIMT machine: counting rules, occupancy, memory, atomics, time. It knows no triangle, tile or patch.

``models.price.price(launches, load_machine("gtx280"), "schedule")`` prices the launches of a frame. What is named
here is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from models import compile_cache

if TYPE_CHECKING:
    from models.errors import TilestampError
    from models.events import MachineEvent
    from models.fixed_function import PipeLaunch
    from models.launch import Launch, Stream
    from models.machine import Machine, altered, list_machines, load_machine
    from models.occupancy import Residency, residency
    from models.simt import Simt
    from models.timing import Timing

compile_cache.set_up()  # before any kernel is imported

_HOMES = {
    "Launch": "launch",
    "Machine": "machine",
    "MachineEvent": "events",
    "PipeLaunch": "fixed_function",
    "Residency": "occupancy",
    "Simt": "simt",
    "Stream": "launch",
    "TilestampError": "errors",
    "Timing": "timing",
    "altered": "machine",
    "list_machines": "machine",
    "load_machine": "machine",
    "residency": "occupancy",
}

__all__ = [
    "Launch",
    "Machine",
    "MachineEvent",
    "PipeLaunch",
    "Residency",
    "Simt",
    "Stream",
    "TilestampError",
    "Timing",
    "altered",
    "list_machines",
    "load_machine",
    "residency",
]


def __getattr__(name: str) -> Any:
    """Load a public name from the module where it lives."""
    if name in _HOMES:
        return getattr(import_module(f"models.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'models' has no attribute {name!r}")
