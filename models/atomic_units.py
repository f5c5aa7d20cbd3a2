"""Atomic units: to which of them addresses are dealt, and how many requests the fullest one gets."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.machine import Machine


class Dealing(NamedTuple):
    """All of a machine that the fullest unit depends on.

    Parameters
    ----------
    unit_bytes : int
        Consecutive bytes that go to one unit.
    units : int
        0: each such stretch has its own.
    """

    unit_bytes: int
    units: int


def dealing_of(machine: Machine) -> Dealing:
    """How a machine deals addresses."""
    return Dealing(machine.atomics.unit_bytes, machine.atomics.units)


def fullest_requests(requests: NDArray[np.int64], dealing: Dealing) -> float:
    """Requests at the atomic unit that gets most.

    Parameters
    ----------
    requests : ndarray, (chunks,), int64
        By chunk of ``CHUNK_BYTES``.
    dealing : Dealing
    """
    if not requests.any():
        return 0.0
    unit = np.arange(len(requests)) * CHUNK_BYTES // dealing.unit_bytes
    return float(np.bincount(unit % dealing.units if dealing.units else unit, weights=requests).max())
