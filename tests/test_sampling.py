"""Sampling: intervals hold the full run's numbers, samples are exact parts of it, and everything is a pure function."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.benchmarks.interval_coverage import coverage
from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.sampling import intervals
from tilestamp.simulator.sampling.estimate import t_quantile
from tilestamp.simulator.sampling.expansion import expanded
from tilestamp.simulator.sampling.strata import Sample, drawn, make_strata, pilot
from tilestamp.simulator.sampling.totals import enlarged, totals

SEEDS = 200
ERROR = 0.02
MICRO = {"width": 320, "height": 240, "bound": 3}


@pytest.fixture
def small_frames(monkeypatch):
    """Sample frames that are too small to be worth it."""
    monkeypatch.setattr("tilestamp.simulator.sampling.executor.PAYS", 0)
    monkeypatch.setattr("tilestamp.simulator.sampling.executor.UNITS_AN_SM", 0)


def population(kind: str, units: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """Sizes and rows of units as unlike as those of a stage: (units,) and (units, 3)."""
    random = np.random.default_rng(len(kind))
    if kind == "even":
        size = random.poisson(40, units)
    elif kind == "skewed":
        size = random.lognormal(3, 1, units).astype(int)
    elif kind == "mostly empty":
        size = random.poisson(30, units) * (random.random(units) < 0.3)
    elif kind == "two kinds":
        size = np.where(random.random(units) < 0.1, random.poisson(300, units), random.poisson(10, units))
    else:  # short lists
        size = random.poisson(2, units)
    hits = random.binomial(64 * size, 0.2)
    tests = 4 * size + random.poisson(3 * size)
    return size, np.stack([10 + 64 * size + tests, tests, hits], axis=1).astype(np.int64)


def run_sample(size: np.ndarray, table: np.ndarray, seed: int, error: float) -> Sample:
    """What a sampler does, on a stage whose rows are known."""
    strata = make_strata(size, [seed])
    taken = pilot(strata)
    for _ in range(5):
        sample = Sample(strata, taken, table[drawn(strata, taken)])
        found = totals(sample, sample.rows.astype(float))
        if (found.half_width <= error * found.value).all():
            break
        taken = enlarged(sample, sample.rows.astype(float), error)
    return Sample(strata, taken, table[drawn(strata, taken)])


@pytest.mark.parametrize("kind", ["even", "skewed", "mostly empty", "two kinds", "short lists"])
def test_intervals_hold_the_total_of_known_populations_in_19_of_20_samples(kind):
    size, table = population(kind)
    held = []
    for seed in range(SEEDS):
        sample = run_sample(size, table, seed, ERROR)
        found = totals(sample, sample.rows.astype(float))
        held += (np.abs(found.value - table.sum(axis=0)) <= found.half_width + 1e-6).tolist()
    assert 0.925 <= np.mean(held) <= 0.985  # of 600 intervals, not all independent


def test_deviations_that_few_units_have_do_not_make_intervals_too_short():
    random = np.random.default_rng(5)
    size = random.poisson(40, 3000) + 1
    table = (64 * size)[:, None]
    table[random.choice(3000, 8, replace=False)] //= 3
    held = []
    for seed in range(SEEDS):
        found = totals(sample := run_sample(size, table, seed, ERROR), sample.rows.astype(float))
        held.append(abs(found.value - table.sum()) <= found.half_width)
    assert np.mean(held) >= 0.93


def test_a_sample_of_everything_has_no_width_and_is_exact():
    size, table = population("skewed")
    strata = make_strata(size, [0])
    sample = Sample(strata, strata.units, table[drawn(strata, strata.units)])
    found = totals(sample, sample.rows.astype(float))
    assert found.value == pytest.approx(table.sum(axis=0))
    assert not found.half_width.any()
    assert (expanded(sample) == table).all()


def test_the_table_of_all_units_adds_up_to_the_estimates():
    size, table = population("two kinds")
    sample = run_sample(size, table, 1, ERROR)
    wide = expanded(sample)
    assert wide.sum(axis=0) == pytest.approx(totals(sample, sample.rows.astype(float)).value, rel=1e-4)
    assert (wide[drawn(sample.strata, sample.taken)] == sample.rows).all()


def test_few_units_tell_a_total_by_the_mean_of_their_stratum():
    strata, table = make_strata(np.full(100, 40), [0]), np.full((100, 1), 7)
    taken = np.array([24, 20])  # too few to fit
    assert totals(Sample(strata, taken, table[drawn(strata, taken)]), table[:44].astype(float)).value == 700


def test_the_first_sample_runs_all_of_the_largest_units():
    size, _ = population("skewed")
    strata = make_strata(size, [0])
    taken = pilot(strata)
    assert set(np.argsort(size, kind="stable")[-24:]) <= set(drawn(strata, taken))


def test_what_is_known_of_all_units_is_no_part_of_the_sample():
    size, table = population("even")
    strata = make_strata(size, [0])
    units = drawn(strata, pilot(strata))
    sample = Sample(strata, pilot(strata), table[units], {1: table[:, 1]})
    assert not sample.sampled[:, 1].any()
    assert (sample.sampled[:, 0] == table[units, 0]).all()
    assert (expanded(sample)[:, 1] == table[:, 1]).all()


def test_units_that_did_not_run_are_as_unlike_as_those_that_ran():
    size = np.full(3000, 40)
    table = np.random.default_rng(3).choice([0, 100], 3000)[:, None]
    assert expanded(run_sample(size, table, 0, 0.5)).std() == pytest.approx(50, rel=0.1)


def one_time(monkeypatch, alone: float, beyond: float):
    """A launch's time that is the first cost of all units, of which one may be long; and half-width and roof."""
    size, table = population("even")
    sample = run_sample(size, table, 0, 0.5)
    wide = expanded(sample)
    costs = sample.rows.astype(float)

    def price(share, columns):
        more = (share * wide[:, 0]).sum() if columns == intervals.ISSUED else 0.0
        return timing(wide[:, 0].sum() + more + (beyond if columns == intervals.EVERYTHING else 0.0))

    def timing(time):
        return SimpleNamespace(milliseconds=float(time), cycles=1.0, terms={"issue": 1.0, "launch": 0.0})

    monkeypatch.setattr(intervals, "_costs", lambda *_: costs)
    monkeypatch.setattr(intervals, "demand", lambda *_: SimpleNamespace(alone=np.full(len(wide), alone)))
    work = SimpleNamespace(sample=sample, table=wide)
    found = intervals.milliseconds(None, timing(wide[:, 0].sum()), work, None, None, price)
    return found.half_width - intervals.LEAST * found.value, totals(sample, costs).half_width[0]


def test_a_time_is_as_unsure_as_the_cost_that_makes_it(monkeypatch):
    half, expected = one_time(monkeypatch, alone=0.0, beyond=5000.0)
    assert half == pytest.approx(expected, rel=0.01)


def test_what_a_long_unit_may_decide_makes_a_time_less_sure(monkeypatch):
    half, expected = one_time(monkeypatch, alone=1.0, beyond=5000.0)
    assert half == pytest.approx(expected + 5000.0, rel=0.01)


def test_few_units_an_sm_are_no_sample(monkeypatch):
    monkeypatch.setattr("tilestamp.simulator.sampling.executor.PAYS", 0)
    assert not simulate("teapot", "micropolygon", "gtx280", error=0.3, width=160, height=120, fidelity="counts").sampled


def test_a_larger_sample_holds_the_smaller_one():
    size, table = population("even")
    strata = make_strata(size, [3])
    small = pilot(strata)
    sample = Sample(strata, small, table[drawn(strata, small)])
    more = enlarged(sample, sample.rows.astype(float), 0.001)
    assert set(drawn(strata, small)) < set(drawn(strata, more))


def test_quantiles_of_t_are_those_of_the_tables():
    assert t_quantile(np.array([1, 4, 5, 10, 30, 1e9])) == pytest.approx(
        [12.706, 2.776, 2.571, 2.228, 2.042, 1.960], abs=0.01
    )


@pytest.mark.usefixtures("small_frames")
def test_every_number_of_a_sampled_run_has_its_interval():
    run = simulate("teapot", "micropolygon", "gtx280", error=0.3, **MICRO)
    assert run.sampled
    assert set(run.counts_interval) == set(run.counts)
    for name, estimate in run.counts_interval.items():
        assert estimate.low <= run.counts[name] <= estimate.high, name
    assert {"milliseconds_low", "milliseconds_high", "instructions_low", "sample_hits_high"} <= set(run.stages)
    low, high = run.milliseconds_interval[1:]
    assert 0 < low < run.milliseconds < high


def test_without_an_error_nothing_is_sampled_and_no_column_is_added():
    run = simulate("teapot", "micropolygon", "gtx280", **MICRO)
    assert not run.sampled
    assert not [name for name in run.stages if name.endswith("_low")]
    assert run.milliseconds_interval.half_width == 0


@pytest.mark.usefixtures("small_frames")
def test_a_sampled_run_says_that_it_has_no_picture():
    run = simulate("teapot", "micropolygon", "gtx280", error=0.3, fidelity="counts", **MICRO)
    with pytest.raises(TilestampError, match="a sampled run draws no picture; ask with error=0"):
        _ = run.image


@pytest.mark.usefixtures("small_frames")
def test_the_same_seed_gives_the_same_numbers_and_another_seed_others():
    first, again, other = (
        simulate(
            "teapot", "cudaraster", "gtx480", width=640, height=480, fidelity="counts", error=0.1, seed=seed
        ).counts
        for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_a_pipeline_that_cannot_be_sampled_runs_in_full_and_says_so():
    run = simulate("teapot", "hardware", "gtx280", width=64, height=48, error=0.1)
    assert not run.sampled
    assert "everything ran" in run.note
    assert run.milliseconds_interval.half_width == 0


@pytest.mark.usefixtures("small_frames")
def test_where_a_part_does_not_tell_enough_all_units_run():
    options = {"width": 320, "height": 240}
    run = simulate("teapot", "micropolygon", "gtx280", error=1e-6, **options)
    full = simulate("teapot", "micropolygon", "gtx280", **options)
    ran, units = run.sampled["units"]["tile_raster"]
    assert ran == units
    assert (run.frame.works[-1].table == full.frame.works[-1].table).all()
    assert run.milliseconds == full.milliseconds
    assert run.milliseconds_interval.half_width == 0


@pytest.mark.usefixtures("small_frames")
def test_all_stages_but_the_last_run_in_full():
    options = {"width": 320, "height": 240, "bound": 3}
    part = simulate("teapot", "micropolygon", "gtx280", fidelity="counts", error=0.3, **options).frame.works
    full = simulate("teapot", "micropolygon", "gtx280", fidelity="counts", **options).frame.works
    assert [work.kernel for work in part] == [work.kernel for work in full]
    assert all((ours.table == theirs.table).all() for ours, theirs in zip(part[:-1], full[:-1], strict=True))
    assert part[-1].streams == full[-1].streams  # lists and stores are known


@pytest.mark.parametrize(("pipeline", "machine"), [("micropolygon", "gtx680"), ("cudaraster", "gtx480")])
def test_intervals_hold_the_full_run_on_a_small_frame(pipeline, machine, monkeypatch):
    """29 of 30 times at least; the table of all machines is ``tests.benchmarks.interval_coverage``."""
    monkeypatch.setattr("tilestamp.simulator.sampling.executor.PAYS", 0)
    found = coverage(pipeline, machine, "teapot", seeds=30)
    assert found.time >= 29 / 30
    assert found.count >= 0.93
    assert found.units < 0.2


@pytest.mark.parametrize(("pipeline", "machine"), [("micropolygon", "gtx280"), ("cudaraster", "gtx480")])
def test_a_frame_that_is_too_small_to_pay_for_a_sample_runs_in_full(pipeline, machine):
    options = {"width": 160, "height": 120}
    run = simulate("teapot", pipeline, machine, error=0.1, **options)
    assert not run.sampled
    assert "a sample would cost more" in run.note
    assert run.milliseconds == simulate("teapot", pipeline, machine, picture=False, **options).milliseconds
    with pytest.raises(TilestampError, match="ask with error=0"):
        _ = run.image


@pytest.mark.parametrize("error", [-0.1, 1.0, float("nan")])
def test_an_error_that_is_no_share_is_refused(error):
    with pytest.raises(TilestampError, match="error takes a number from 0 to below 1"):
        simulate("teapot", error=error)


@pytest.mark.parametrize(("pipeline", "machine"), [("micropolygon", "gtx280"), ("cudaraster", "gtx480")])
def test_without_a_picture_the_numbers_are_the_same(pipeline, machine):
    options = {"width": 160, "height": 120}
    drawn = simulate("teapot", pipeline, machine, **options)
    numbers = simulate("teapot", pipeline, machine, picture=False, **options)
    assert numbers.counts == drawn.counts
    assert numbers.milliseconds == drawn.milliseconds
    with pytest.raises(TilestampError, match="only numbers were asked for; ask with picture=True"):
        _ = numbers.image
