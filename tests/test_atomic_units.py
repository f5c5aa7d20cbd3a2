"""Which L2 unit owns an address, and how long the fullest is busy."""

import numpy as np
import pytest

from tilestamp.models.atomic_units import HASHES, RUN, UNDER_WAY, dealing_of, fullest_unit_ns
from tilestamp.models.machine import load_machine

H200 = dealing_of(load_machine("h200"))
EACH = H200._replace(units=0, unit_ns=4.0, spread_ns=1.0)  # a unit a stretch


def table(*addresses, count=10):
    """Requests by chunk: ``count`` at each of some byte addresses."""
    requests = np.zeros(max(addresses) // 32 + 1, np.int64)
    requests[[a // 32 for a in addresses]] = count
    return requests


def naive(requests, dealing):
    """The same, chunk by chunk and hash by hash."""
    found = []
    for hashed in range(HASHES):
        owners = max(np.flatnonzero(requests)) * 32 // 1024 * 2 + 2
        starts = np.random.default_rng(hashed).integers(0, dealing.units, owners // RUN + 1)
        units = {}
        for chunk, count in enumerate(requests):
            owner = chunk // 32 * 2 + chunk // 8 % 2
            units.setdefault((starts[owner // RUN] + owner % RUN) % dealing.units, []).append(int(count))
        spread, same = dealing.spread_ns, dealing.unit_ns
        busy = []
        for counts in units.values():
            total = sum(counts)
            again = min(1.0, UNDER_WAY * sum(c * c for c in counts) / max(1, total) ** 2)
            busy.append(total * (spread + (same - spread) * again))
        found.append(max(busy))
    return np.mean(found)


@pytest.mark.parametrize(("other", "together"), [(224, True), (256, False), (512, True), (768, False), (1024, False)])
def test_two_units_take_turns_of_256_bytes_in_each_kib(other, together):
    """As an SM found them on the H200: it is slower where one unit owns both addresses."""
    assert fullest_unit_ns(table(0, other), EACH) == (80 if together else 40)


def test_one_address_is_wanted_again_and_again():
    assert fullest_unit_ns(table(4096), H200) == pytest.approx(10 * H200.unit_ns)


def test_a_request_waits_where_its_sector_is_under_way():
    """Of 8 sectors in a stretch one is nearly always among 16 under way; of 16 sectors in turn, just so."""
    assert fullest_unit_ns(table(*range(0, 256, 32)), EACH) == 80 * 4
    less = table(*range(0, 256, 32), *range(512, 768, 32), count=10)
    assert fullest_unit_ns(less, EACH) == 160 * 4
    assert fullest_unit_ns(np.full(64 * 32, 10), EACH._replace(unit_bytes=1 << 20)) < 2 * 20480


def test_the_mean_of_some_hashes_by_hand():
    requests = np.random.default_rng(3).integers(0, 50, 5000)
    assert fullest_unit_ns(requests, H200) == pytest.approx(naive(requests, H200))


def test_locks_own_consecutive_bytes():
    gtx280 = dealing_of(load_machine("gtx280"))
    assert fullest_unit_ns(table(0, 32, 64), gtx280) == pytest.approx(10 * gtx280.unit_ns)


def test_without_requests_no_unit_is_busy():
    assert fullest_unit_ns(np.zeros(4, np.int64), H200) == 0
