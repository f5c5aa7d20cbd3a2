"""How far a predicted time may be off: factors from residuals, and intervals from factors."""

import numpy as np
import pandas as pd
import pytest

from tilestamp import simulate
from tilestamp.experiments.calibration.residuals import by_term, conformal_factor, coverage
from tilestamp.models import error_model
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.timing import Timing

H200 = load_machine("h200")


@pytest.fixture
def factors(monkeypatch):
    """Residuals of our own."""
    table = {"h200": {"all": 1.5, "issue": 1.25}, "elsewhere": {"all": 2.0}}
    monkeypatch.setattr(error_model, "residuals", lambda: table)


def timing(milliseconds, bound):
    return Timing("s", "k", {}, 1.0, milliseconds, bound, 1.0, 0.0, 0.0)


def test_of_38_ratios_the_largest_is_the_factor_and_fewer_have_none():
    assert conformal_factor([1.0 / 1.4, *[1.1] * 37]) == pytest.approx(1.4)
    assert conformal_factor([*[1.1] * 18, 1.3]) == pytest.approx(1.3)
    assert conformal_factor([1.1] * 18) is None


def test_the_next_ratio_lies_within_the_factor_in_95_of_100_cases():
    drawn = np.exp(np.random.default_rng(1).standard_t(2, (4000, 101)) / 10)  # heavy tails: no normal would do
    inside = [abs(np.log(row[100])) <= np.log(conformal_factor(list(row[:100]))) for row in drawn]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.01)


def test_a_term_with_few_times_takes_the_factor_of_all():
    times = pd.DataFrame({"bound": ["issue"] * 40 + ["dram"] * 3, "ours": 1.0, "measured": [1.1] * 40 + [1.6] * 3})
    found = by_term(times)
    assert set(found) == {"all", "issue"}
    assert found["issue"] == (40, pytest.approx(1.1))
    assert coverage(times, {"all": (1, 1.5), "issue": (1, 1.05)}) == 0
    assert coverage(times, {"all": (1, 1.7), "issue": (1, 1.05)}) == pytest.approx(3 / 43)


def test_an_interval_is_the_sum_of_its_launches_intervals(factors):
    low, high = error_model.error_interval([timing(5.0, "issue"), timing(3.0, "dram")], H200)
    assert (low, high) == (pytest.approx(5.0 / 1.25 + 3.0 / 1.5), pytest.approx(5.0 * 1.25 + 3.0 * 1.5))


OTHERS = {"gtx480": load_machine("gtx480"), "what-if": altered(H200, {"sm.count": 140})}


@pytest.mark.parametrize("name", OTHERS)
def test_where_no_kernel_was_measured_the_published_times_count(name, factors):
    assert error_model.error_interval([timing(3.0, "issue")], OTHERS[name]) == (1.5, 6.0)


def test_a_frame_and_its_stages_bear_intervals():
    run = simulate("teapot", "micropolygon", "h200", width=96, height=64)
    low, high = run.error_interval
    assert low < run.milliseconds < high
    assert run.stages.error_low_milliseconds.sum() == pytest.approx(low)
    assert run.stages.error_high_milliseconds.sum() == pytest.approx(high)
