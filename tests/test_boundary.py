"""The frame of the stability atlas: bisection, sweeps, rows."""

import pytest

from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket


@pytest.mark.parametrize("scale", ["log", "linear"])
def test_bisection_closes_on_the_crossing(scale):
    holds, breaks = bisect(lambda x: x >= 37.5, 1.0, 1000.0, scale=scale, tolerance=1e-4)
    assert holds < 37.5 <= breaks
    assert breaks - holds < 0.2


def test_whole_numbers_close_to_neighbours():
    seen = []
    assert bisect(lambda n: seen.append(n) or n > 12, 1, 100, scale="integer") == (12, 13)
    assert all(isinstance(n, int) for n in seen)


def test_the_hard_end_may_be_the_smaller_number():
    holds, breaks = bisect(lambda x: x < 1e-3, 1.0, 1e-6)
    assert breaks < 1e-3 <= holds


def test_what_never_breaks_is_said_so():
    assert bisect(lambda _: False, 1.0, 8.0) == (8.0, None)


def test_what_breaks_at_once_is_said_so():
    assert bisect(lambda _: True, 1.0, 8.0) == (None, 1.0)


def test_without_tolerance_left_it_stops_at_neighbouring_floats():
    holds, breaks = bisect(lambda x: x > 0.3, 0.1, 0.9, tolerance=0.0)
    assert holds == 0.3
    assert breaks - holds < 1e-15


def test_a_sweep_brackets_the_first_failure():
    assert bracket([1, 2, 4, 8], [False, False, True, True]) == (2, 4)
    assert bracket([1, 2, 4, 8], [False] * 4) == (1, 8)


def test_a_row_says_what_holds_what_breaks_and_what_the_cure_costs():
    row = Boundary("m", "aspect", ":1", 8.0, 9.0, "a hole", "snapping", "+1 ms")
    result = atlas_result("stability/x", "X", [row, Boundary("n", "aspect", ":1", 64.0, None, "")])
    assert [(c.column, c.ours) for c in result.cells] == [
        ("aspect holds at", 8.0),
        ("aspect breaks at", 9.0),
        ("aspect holds at", 64.0),
        ("aspect breaks at", "none tried"),
    ]
    assert result.notes == [
        "m: from aspect 9 :1, a hole. Cure: snapping (+1 ms).",
        "Never breaks up to aspect 64 :1: n.",
    ]
    assert next(iter(result.tables["boundaries"].breaks)) == 9.0


def test_the_answer_of_the_atlas_names_the_first_that_breaks():
    rows = [Boundary("a", "size", "px", 9, None, ""), Boundary("b", "size", "px", 1, 2, "holes: many"),
            Boundary("c", "size", "px", 3, 4, "spills")]  # fmt: skip
    assert atlas_result("stability/x", "", rows).answer == "2 of 3 break; b from size 2 px on: holes."
