"""One launch at one fidelity, with bytes that are given."""

from tilestamp.models.price import price
from tilestamp.models.traffic import traffic


def bounds(launch, machine, moved):
    return price([launch], machine, "bounds", [moved])[0]


def schedule(launch, machine, moved):
    return price([launch], machine, "schedule", [moved])[0]


def microseconds(launch, machine):
    return schedule(launch, machine, traffic([launch], machine)[0]).milliseconds * 1e3
