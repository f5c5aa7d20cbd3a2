"""Atomic units: which of them owns an address, and how long the one with the most to do is busy.

Where atomics lock DRAM, each stretch of ``unit_bytes`` has its own lock. L2 units were mapped on an H200 (one SM adds
at two addresses at a time: it takes longer where one unit owns both): 47 units, two for each KiB, which take turns of
256 bytes. So a unit owns ``unit_bytes``, every other quarter of ``2 unit_bytes``. Which units follow each other is a
hash of the physical address: of eight such stretches side by side none share a unit, of 128 the fullest unit has 4.7,
of 256 it has 7.6. The hash changes with the allocation, so the time here is the mean over some of our own: runs of 24
different units from a random one on (5.3 and 9.1).

A unit takes ``unit_ns_per_request`` where one address is wanted again and again, and ``spread_ns_per_request`` at many
addresses: a request waits where its sector is among those under way.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.machine import Machine

RUN = 24  # consecutive owners that are different units
HASHES = 6
UNDER_WAY = 16  # requests in a unit: at 16 sectors of one unit in turn each takes 0.69 ns


class Dealing(NamedTuple):
    """All of a machine that the fullest unit depends on: as of ``models.machine_parts.Atomics``."""

    locks: bool  # that hold DRAM, in place of units of L2
    unit_bytes: int
    units: int
    unit_ns: float
    spread_ns: float


def dealing_of(machine: Machine) -> Dealing:
    """How a machine deals addresses."""
    atomics = machine.atomics
    spread = atomics.spread_ns_per_request or atomics.unit_ns_per_request
    return Dealing(atomics.place == "dram_lock", atomics.unit_bytes, atomics.units, atomics.unit_ns_per_request, spread)


def fullest_unit_ns(requests: NDArray[np.int64], dealing: Dealing) -> float:
    """Nanoseconds for which the unit with the most to do is busy.

    Parameters
    ----------
    requests : ndarray, (chunks,), int64
        By chunk of ``CHUNK_BYTES`` of the target buffer.
    dealing : Dealing
    """
    if not requests.any():
        return 0.0
    where = np.flatnonzero(requests)
    wanted = requests[where].astype(np.float64)
    owner = _owners(where * CHUNK_BYTES, dealing)
    many, pairs = _totals(owner, wanted), _totals(owner, wanted**2)
    if not dealing.units:
        return float(_busy_ns(many, pairs, dealing).max())
    found = []
    for hashed in range(HASHES):
        unit = _units(len(many), dealing.units, hashed)
        found.append(_busy_ns(_totals(unit, many), _totals(unit, pairs), dealing).max())
    return float(np.mean(found))


def _totals(owner: NDArray[np.int64], amounts: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.bincount(owner, amounts).astype(np.float64)


def _owners(addresses: NDArray[np.int64], dealing: Dealing) -> NDArray[np.int64]:
    """Stretches that one lock or unit owns, numbered."""
    if dealing.locks:
        return addresses // dealing.unit_bytes
    owners: NDArray[np.int64] = (
        addresses // (2 * dealing.unit_bytes) * 2 + addresses // max(1, dealing.unit_bytes // 2) % 2
    )
    return owners


def _units(owners: int, units: int, hashed: int) -> NDArray[np.int64]:
    """Unit of each stretch: runs of neighbours from a random unit on."""
    starts = np.random.default_rng(hashed).integers(0, units, -(-owners // RUN))
    dealt: NDArray[np.int64] = (np.repeat(starts, RUN)[:owners] + np.arange(owners) % RUN) % units
    return dealt


def _busy_ns(many: NDArray[np.float64], pairs: NDArray[np.float64], dealing: Dealing) -> NDArray[np.float64]:
    """Nanoseconds of units by their requests, and by the sum of squares of their sectors' requests."""
    again = np.minimum(1.0, UNDER_WAY * pairs / np.maximum(many, 1.0) ** 2)  # a request meets its sector under way
    busy: NDArray[np.float64] = many * (dealing.spread_ns + (dealing.unit_ns - dealing.spread_ns) * again)
    return busy
