"""Auto: the proof that a schedule cannot end later, and the choice that rests on it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp import simulate
from tilestamp.models import auto
from tilestamp.models.auto import ERROR
from tilestamp.models.bounds import bounds, longest, pricing_of
from tilestamp.models.errors import TilestampError
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.fidelity_bound import latest_end
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import list_machines, load_machine
from tilestamp.models.price import price
from tilestamp.models.schedule import loads, played, schedule
from tilestamp.models.traffic import Traffic, traffic
from tilestamp.simulator.pipelines import pipeline_names

ROUNDING = 1 + 1e-9
GTX280, GTX480, H200 = (load_machine(name) for name in ("gtx280", "gtx480", "h200"))
MACHINES = (GTX280, GTX480, H200)
COLUMNS = ("FP32", "SHARED", "CHAIN_LOAD", "LOAD_BYTES", "ATOMIC_REQUESTS")
NOTHING = Traffic(0.0, 0.0, 1.0)


def launch(units, block=64, dispatch="blocks", grid=None, **events):
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
        shared_bytes=0,
        events=table,
        dispatch=dispatch,
    )


def latest_cycles(what, machine, moved=NOTHING):
    """Cycles of a launch that its schedule cannot exceed."""
    pricing = pricing_of(what, machine, moved)
    end = latest_end(loads(pricing))
    return pricing.terms["launch"] + max(end, longest(pricing.terms, pricing.units))


@settings(deadline=None, max_examples=100)
@given(
    units=st.integers(1, 1500),
    seed=st.integers(0, 10**6),
    dispatch=st.sampled_from(["blocks", "block_queue", "warp_queue"]),
    machine=st.sampled_from(MACHINES),
    block=st.sampled_from([32, 96, 512]),
    spread=st.sampled_from([0.0, 1.0, 3.0]),
)
def test_no_schedule_ends_after_the_latest_end(units, seed, dispatch, machine, block, spread):
    """Log-normal units in any mixture of terms: alike, unlike, and with rare giants."""
    draw = np.random.default_rng(seed)
    scale = 10.0 ** draw.uniform(0, 4, len(COLUMNS))
    events = {name: scale[i] * draw.lognormal(0, spread, units) for i, name in enumerate(COLUMNS)}
    what = launch(units, block, dispatch, 40, **events)
    moved = Traffic(float(events["LOAD_BYTES"].sum()), 0.0, 1.0)
    assert schedule(what, machine, moved).cycles <= latest_cycles(what, machine, moved) * ROUNDING


@settings(deadline=None, max_examples=40)
@given(units=st.integers(1, 3000), seed=st.integers(0, 10**6), machine=st.sampled_from(MACHINES))
def test_no_order_of_units_ends_after_the_latest_end(units, seed, machine):
    """Sorted units: giants first or last, phases of one term and then of another."""
    draw = np.random.default_rng(seed)
    work = np.sort(draw.lognormal(6, 2, units))
    what = launch(units, FP32=work[:: draw.choice([-1, 1])], CHAIN_LOAD=np.sort(draw.lognormal(1, 1, units)))
    assert schedule(what, machine, NOTHING).cycles <= latest_cycles(what, machine) * ROUNDING


def test_of_many_equal_units_the_latest_end_is_near_the_schedule():
    """Blocks of 512 threads, four an SM: an SM's work and its residents' own time, a quarter each, and one unit."""
    what, machine = launch(4 * 132 * 100, 512, FP32=5000, CHAIN_LOAD=1), H200
    assert latest_cycles(what, machine) <= 2.1 * schedule(what, machine, NOTHING).cycles


@pytest.fixture(scope="module", params=pipeline_names())
def frames(request):
    """The contract's frame of each pipeline, priced on every machine that can launch it."""
    run = simulate("teapot", request.param, "h200", width=96, height=72, fidelity="auto")
    return [other for name in list_machines() if (other := _launched(run, name)) is not None]


def _launched(run, name):
    """Price the run on a machine of any SIMT shape: that counts would differ there is nothing to these proofs."""
    other = replace(run, machine=load_machine(name))
    try:
        price(other.launches, other.machine, "bounds")
    except TilestampError:
        return None
    return other


def test_the_bound_holds_for_every_launch_of_every_pipeline_on_every_machine(frames):
    for run in frames:
        for what, moved in zip(run.launches, traffic(run.launches, run.machine), strict=True):
            if isinstance(what, Launch):
                pricing = pricing_of(what, run.machine, moved)
                latest = latest_cycles(what, run.machine, moved)
                assert played(pricing, loads(pricing)).cycles <= latest * ROUNDING, (what.kernel, run.machine.name)


@pytest.mark.parametrize("error", [0.01, 0.1])
def test_the_frame_is_within_the_error_of_its_schedule(frames, error):
    for run in frames:
        ours, full = (sum(t.cycles for t in price(run.launches, run.machine, f, error)) for f in ("auto", "schedule"))
        assert full * (1 - error) <= ours <= full * ROUNDING, run.machine.name


def test_a_launch_is_within_its_own_error_bound(frames):
    for run in frames:
        full = price(run.launches, run.machine, "schedule")
        for ours, theirs in zip(run.timings, full, strict=True):
            assert theirs.cycles * (1 - ours.error_bound) <= ours.cycles * ROUNDING, (ours.kernel, run.machine.name)


def test_every_launch_says_what_was_chosen_and_why(frames):
    for run in frames:
        assert all(t.why and t.fidelity in ("bounds", "schedule") for t in run.timings)
        assert run.stages["why"].str.len().min() > 0


def test_a_launch_of_unlike_units_is_escalated_and_names_its_tail():
    work = np.full(5000, 100.0)
    work[-1] = 10**6
    (got,) = price([launch(5000, FP32=work)], GTX280, "auto")
    assert got.fidelity == "schedule"
    assert got.why == f"bounds up to {got.why.split()[3]} low"


def test_a_launch_of_equal_units_that_only_wait_stays_at_its_roofline():
    what, machine = launch(132 * 32 * 50, CHAIN_LOAD=2000), H200
    (got,) = price([what], machine, "auto")
    assert got.fidelity == "bounds"
    assert got.cycles == bounds(what, machine, traffic([what], machine)[0]).cycles
    assert got.error_bound <= ERROR


def test_a_small_launch_stays_beside_a_large_one_and_is_escalated_alone():
    machine = GTX280
    work = np.full(300, 100.0)
    work[-1] = 10**5
    small, large = launch(300, FP32=work), launch(30 * 8 * 500, FP32=50000)
    assert price([small], machine, "auto")[0].fidelity == "schedule"
    got = price([small, large], machine, "auto")[0]
    assert got.fidelity == "bounds"
    assert got.why.startswith("small")
    assert got.error_bound > ERROR


def test_a_smaller_error_never_escalates_less(frames):
    for run in frames:
        counts = [
            sum(t.fidelity == "schedule" for t in price(run.launches, run.machine, "auto", error))
            for error in (0.3, 0.03, 0.003)
        ]
        assert counts == sorted(counts), run.machine.name


def test_a_fixed_function_pass_is_exact_at_every_fidelity():
    got = price([PipeLaunch(stage="hardware", kernel="draw", items={"primitives": 1e6})], GTX480, "auto")[0]
    assert got.error_bound == 0.0
    assert got.why == "fixed function"


def test_a_launch_without_work_is_known():
    (got,) = price([launch(0, grid=1)], H200, "auto")
    assert got.error_bound == 0.0


@pytest.mark.parametrize(("least", "stays"), [(1.0, True), (50.0, False)])
def test_a_launch_stays_at_its_roofline_where_its_gap_is_small_beside_the_frame(least, stays):
    """Twice what the roofline says is 5 % of a frame of 100 more cycles, or much more than that."""
    kept = auto._kept(np.array([100.0, least]), np.array([100.0, 2 * least]), 0.05)
    assert kept.tolist() == [True, stays]
