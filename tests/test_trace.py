"""Traces: parsed back, the slices add up to the launch; merged ones cover the same; counters hold what was moved."""

import gzip
import json
from collections import defaultdict

import numpy as np
import pytest

from tilestamp import TilestampError, altered, load_machine, simulate
from tilestamp.experiments.commands import trace
from tilestamp.reports.chrome_trace import Process, write_trace
from tilestamp.simulator.run_views import taken
from tilestamp.simulator.timeline import timeline

NANOSECOND = 1e-3  # of a microsecond


@pytest.fixture(scope="module", params=["micropolygon gtx280", "cudaraster gtx480", "hardware gtx480"])
def run(request):
    pipeline, machine = request.param.split()
    return simulate("teapot", pipeline=pipeline, machine=machine, width=160, height=120, picture=False)


@pytest.fixture(scope="module")
def events(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("trace") / "run.json.gz"
    trace.write_schedule(run, path)
    return parsed(path)


def parsed(path):
    return json.loads(gzip.decompress(path.read_bytes()))["traceEvents"]


def slices(events, pid=None):
    return [e for e in events if e["ph"] == "X" and e["tid"] > 0 and pid in (None, e["pid"])]


def parts(events, pid):
    return [e for e in events if e["ph"] == "X" and e["tid"] == 0 and e["pid"] == pid]


def test_a_process_a_launch_whose_parts_add_up_to_its_time(run, events):
    for pid, timing in enumerate(run.timings, 1):
        lengths = [e["dur"] for e in parts(events, pid)]
        assert sum(lengths) == pytest.approx(timing.milliseconds * 1e3, abs=NANOSECOND)


def test_the_launches_follow_each_other_and_end_with_the_frame(run, events):
    last = max(e["ts"] + e["dur"] for e in events if e["ph"] == "X")
    assert last == pytest.approx(run.milliseconds * 1e3, abs=NANOSECOND * len(run.timings))


def test_units_begin_and_end_within_the_part_of_their_launch(events):
    for pid in {e["pid"] for e in slices(events)}:
        part = next(e for e in parts(events, pid) if e["name"] == "units on the SMs")
        mine = slices(events, pid)
        rounding = 1.01 * part["dur"] / 30_000 + NANOSECOND
        assert min(e["ts"] for e in mine) >= part["ts"] - rounding
        assert max(e["ts"] + e["dur"] for e in mine) == pytest.approx(part["ts"] + part["dur"], abs=rounding)


def test_a_slice_a_unit_with_its_number_and_items(run, events):
    for pid, work in enumerate(run.frame.works, 1):
        mine = slices(events, pid)
        if hasattr(work, "table"):
            numbers = sorted(next(iter(e["args"].values())) for e in mine)
            assert numbers == list(range(len(work.table)))
        else:
            assert mine == []


def test_the_items_of_a_tile_are_its_grids():
    run = simulate("teapot", width=160, height=120, picture=False)
    last = list(timeline(run))[-1]
    work = run.frame.works[-1]
    assert last.what == "grids"
    assert last.items.tolist() == work.table[:, work.events["GRIDS"]].tolist()


def test_no_thread_has_two_slices_at_a_time(events):
    ends = defaultdict(float)
    for e in sorted(slices(events), key=lambda e: e["ts"]):
        thread = e["pid"], e["tid"]
        assert e["ts"] >= ends[thread] - 0.02  # both are rounded
        ends[thread] = e["ts"] + e["dur"]


def test_threads_have_the_names_of_their_sm(run, events):
    named = {(e["pid"], e["tid"]): e["args"]["name"] for e in events if e["name"] == "thread_name"}
    assert {(e["pid"], e["tid"]) for e in slices(events)} <= named.keys()
    sms = {name.split()[1] for (_, tid), name in named.items() if tid}
    assert len(sms) <= run.machine.sm.count


def test_the_bandwidths_hold_all_bytes_and_the_warps_are_those_that_fit(run):
    for launch, timing in zip(timeline(run), run.timings, strict=True):
        for name, total in (("DRAM GB/s", timing.dram_bytes), ("L2 GB/s", timing.l2_bytes)):
            times, values = launch.counters.get(name, (np.zeros(1), np.zeros(1)))
            moved = (values[:-1] * np.diff(times)).sum() * 1e3
            assert name not in launch.counters or moved == pytest.approx(total, rel=1e-6)
        _, waits = launch.counters.get("atomic backlog us", (0, np.zeros(1)))
        assert waits.min() >= 0.0
        _, warps = launch.counters.get("resident warps", (0, np.zeros(1)))
        assert warps.max() <= run.machine.sm.count * run.machine.sm.max_warps


def test_merged_slices_are_few_enough_cover_the_same_and_say_how_many(tmp_path):
    rng = np.random.default_rng(3)
    thread = np.repeat(np.arange(1, 8), [1, 2, 50, 3, 40, 7, 20])
    stop = np.concatenate([np.cumsum(rng.permutation(np.arange(1, n + 1))) for n in np.bincount(thread)[1:]]).astype(
        float
    )
    first = np.flatnonzero(np.diff(thread, prepend=0))
    start = np.append(0.0, stop[:-1])
    start[first] = 0.0
    amount = rng.integers(0, 50, len(thread))
    label = rng.integers(0, 2, len(thread))
    number = np.arange(len(thread))
    process = Process("p", (), {}, thread, start, stop, label, ("a", "b"), number, amount, "block", "items")
    together = write_trace([process], tmp_path / "t.json.gz", 40)
    found = slices(parsed(tmp_path / "t.json.gz"))
    assert together > 1
    assert len(found) <= 40
    assert sum(e["args"]["units"] for e in found) == len(thread)
    assert sum(e["args"]["items"] for e in found) == amount.sum()
    assert sum(e["dur"] for e in found) == pytest.approx((stop - start).sum())
    for tid in range(1, 8):
        mine = np.flatnonzero(thread == tid)
        groups = [mine[i : i + together] for i in range(0, len(mine), together)]
        names = ["ab"[label[max(group, key=lambda i: (stop - start)[i])]] for group in groups]
        assert [e["name"] for e in found if e["tid"] == tid] == names


def test_a_trace_says_that_neighbours_were_merged(run, tmp_path, monkeypatch):
    monkeypatch.setattr(trace, "SLICES", 30)
    units = sum(len(launch.start) for launch in timeline(run))
    said = trace.write_schedule(run, tmp_path / "t.json.gz")
    assert ("neighbours" in said or "without" in said) == (units > 30)
    assert len(slices(parsed(tmp_path / "t.json.gz"))) <= 30


def test_a_roofline_has_no_units_and_says_so(tmp_path):
    run = simulate("teapot", width=64, height=48, picture=False, fidelity="bounds")
    trace.write_schedule(run, tmp_path / "t.json.gz")
    events = parsed(tmp_path / "t.json.gz")
    assert slices(events) == []
    assert any("not scheduled" in e["name"] for e in events)


def test_a_trace_that_cannot_be_written_leaves_nothing(tmp_path, run):
    (tmp_path / "partial.t.json.gz").mkdir()
    with pytest.raises(TilestampError, match="--trace"):
        trace.write_schedule(run, tmp_path / "t.json.gz")
    assert not (tmp_path / "t.json.gz").exists()


def test_what_an_sm_has_taken_is_the_time_of_its_units(run):
    edges = np.linspace(0.0, run.milliseconds * 1e3, 98)
    for launch in timeline(run):
        busy = taken(launch, edges)
        spent = np.bincount(launch.sm, launch.stop - launch.start, launch.sms)
        assert (busy * launch.slots).sum(axis=1) * edges[1] == pytest.approx(spent)
        assert busy.max(initial=0.0) <= 1 + 1e-9


def test_a_queue_that_is_served_in_time_has_no_backlog():
    quick = altered(load_machine("gtx280"), {"atomics.unit_ns_per_request": 0.01, "atomics.conflict_ns": 0.0})
    run = simulate("teapot", machine=quick, width=160, height=120, picture=False)
    backlogs = [t.counters["atomic backlog us"][1] for t in timeline(run) if "atomic backlog us" in t.counters]
    assert backlogs
    assert min(values.min() for values in backlogs) == 0.0


def test_each_event_has_what_the_format_asks_of_its_kind(events):
    numbers = {"X": ("ts", "dur", "tid"), "C": ("ts",), "M": ("tid",)}
    for event in events:
        assert isinstance(event["pid"], int)
        assert isinstance(event["name"], str)
        assert all(event[key] >= 0 for key in numbers[event["ph"]])
    for event in events:
        if event["ph"] == "M":
            assert event["name"] in ("process_name", "thread_name")
            assert list(event["args"]) == ["name"]
        if event["ph"] == "C":
            assert all(isinstance(value, int | float) for value in event["args"].values())
