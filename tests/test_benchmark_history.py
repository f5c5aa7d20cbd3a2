"""A run of the benchmarks becomes lines of their history."""

import pytest

from tests.benchmarks import history


def test_a_line_is_a_median_and_its_ratio_to_the_yardstick_of_the_same_run(tmp_path):
    medians = {"test_yardstick": 0.01, "test_frame": 0.25}
    report = {"benchmarks": [{"name": name, "stats": {"median": median}} for name, median in medians.items()]}
    report["benchmarks"][1]["extra_info"] = {"peak_mb": 7}
    rows = history.run_rows(report, "abc1234", "2026-11-29")
    assert rows.to_dict("records") == [
        {
            "day": "2026-11-29", "commit": "abc1234", "benchmark": "test_frame", "ms": 250.0,
            "ratio": pytest.approx(25), "noted": '{"peak_mb": 7}',
        }
    ]  # fmt: skip
    history.plot(rows, tmp_path / "history.png")
    assert (tmp_path / "history.png").stat().st_size > 0
