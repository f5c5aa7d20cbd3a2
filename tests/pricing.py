"""One launch at one fidelity, with bytes that are given."""

from tilestamp.models.price import price


def bounds(launch, machine, moved):
    return price([launch], machine, "bounds", [moved])[0]


def schedule(launch, machine, moved):
    return price([launch], machine, "schedule", [moved])[0]
