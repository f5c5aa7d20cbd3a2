"""One launch, by the events of its units, at one fidelity, with bytes that are given."""

import numpy as np

from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.price import price
from tilestamp.models.traffic import Traffic, traffic

GTX280 = altered(  # blocks start at once, round rates
    load_machine("gtx280"), {"launch.blocks_per_us": 400.0, "fixed_function.per_clock.primitives": 1.0}
)
H200 = load_machine("h200")
NOTHING = Traffic(0.0, 0.0, 1.0)


def launch_of(units, block=64, *, grid=None, shared_bytes=0, dispatch="blocks", streams=(), requests=None, **events):
    """Describe units by event: one number for all, or one each."""
    table = np.zeros((units, EVENTS))
    for name, count in events.items():
        table[:, MachineEvent[name]] = count
    return Launch(
        stage="stage",
        kernel="kernel",
        grid=grid or units,
        block=block,
        registers=16,
        shared_bytes=shared_bytes,
        events=table,
        dispatch=dispatch,
        streams=tuple(streams),
        atomic_requests=requests,
    )


def bounds(launch, machine, moved):
    return price([launch], machine, "bounds", [moved])[0]


def schedule(launch, machine, moved):
    return price([launch], machine, "schedule", [moved])[0]


def microseconds(launch, machine):
    return schedule(launch, machine, traffic([launch], machine)[0]).milliseconds * 1e3
