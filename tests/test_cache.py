"""What a cache holds from launch to launch: by hand, and beside DRAM bytes that were measured on an H200."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tilestamp.models.cache import Cache
from tilestamp.models.machine import load_machine
from tilestamp.models.traffic import caches_of

PAIRS = Path(__file__).parents[1] / "experiments" / "silicon" / "measured" / "l2_pairs.csv"
MIB = 1 << 20


def test_launches_that_fit_leave_all_and_nothing_goes_to_dram():
    cache = Cache(100, 100)
    assert cache.run({"a": 40, "b": 60}, {"a": 40}) == ({"a": 0, "b": 0}, 0)
    assert cache.run({"a": 40, "b": 60}, {}) == ({"a": 40, "b": 60}, 0)


def test_buffers_of_a_launch_that_do_not_fit_share_the_cache_by_footprint():
    """Of 50 and 150 there remain 25 and 75; what was written of the rest is written back."""
    cache = Cache(100, 100)
    assert cache.run({"a": 50, "b": 150}, {"b": 150})[1] == 75
    found, back = cache.run({"c": 25}, {})
    assert (found["c"], back) == (0, 0.75 * 25)


def test_the_oldest_buffer_leaves_first():
    cache = Cache(100, 100)
    for name in "abc":
        cache.run({name: 40}, {})
    assert cache.run({"a": 40}, {})[0]["a"] == pytest.approx(
        20 * (1 - 22.2 / 200), rel=0.01
    )  # 20 were left, 22.2 came in
    assert cache.run({"c": 40}, {})[0]["c"] == 40


def test_what_a_launch_brings_in_takes_the_room_of_older_buffers_first():
    """60 of old bytes leave before any of the 40 that it finds; of 100 more, the last 40 push out two in ten."""
    for more, found in ((60, 40.0), (100, 40 * (1 - 40 / 100 * 40 / 200))):
        cache = Cache(100, 100)
        cache.run({"old": 60}, {})
        cache.run({"a": 40}, {})
        assert cache.run({"a": 40, "new": more}, {})[0]["a"] == pytest.approx(found, rel=0.05)


def test_what_a_launch_leaves_alone_goes_before_what_it_uses():
    """Of 90 it reads 60 again, and 40 that it writes push out the others: nothing that it wrote."""
    cache = Cache(100, 100)
    cache.run({"a": 90}, {})
    assert cache.run({"a": 60, "b": 40}, {"b": 40})[1] == 0
    assert cache.run({"b": 40}, {})[0]["b"] == 40


def test_more_than_may_be_dirty_is_written_back_the_oldest_first():
    cache = Cache(100, 30)
    assert cache.run({"a": 20}, {"a": 20})[1] == 0
    assert cache.run({"b": 20}, {"b": 20})[1] == 10
    assert cache.run({"a": 20}, {})[0]["a"] == 20  # written back, and still there


def sequences():
    """Of each case: what was measured of each launch, as launches of buffers, and MiB read and written."""
    with PAIRS.open() as file:
        rows = list(csv.DictReader(file))
    for case in {row["case"]: None for row in rows}:
        yield (
            case.split("; "),
            [[float(row[f"{way}_mib"]) for way in ("read", "written")] for row in rows if row["case"] == case],
        )


def moved(launches, cache):
    """MiB that the model reads and writes in each of some launches."""
    cache.run({"before": 256 * MIB}, {})
    for launch in launches:
        parts = {part[0]: (part[1], int(part[2:]) * MIB) for part in launch.split()}
        footprints = {name: size for name, (_, size) in parts.items()}
        written = {name: size for name, (op, size) in parts.items() if op == "s"}
        found, back = cache.run(footprints, written)
        yield [sum(size - found[name] for name, size in footprints.items() if name not in written) / MIB, back / MIB]


def test_launches_one_after_another_read_and_write_what_was_measured_on_the_h200():
    """49 sequences of 8 to 128 MiB; what was dirty and is stored again is written back oftener than we say."""
    caches = caches_of(load_machine("h200"))
    found = [
        (o, m)
        for launches, m in sequences()
        for o in [list(moved(launches, Cache(caches.l2_bytes, caches.dirty_bytes)))]
    ]
    ours, measured = (np.concatenate(side) for side in zip(*found, strict=True))
    read, written = np.abs(ours - measured).mean(axis=0)
    assert len(ours) == 129
    assert read < 1.3
    assert written < 3.0
