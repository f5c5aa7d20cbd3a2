"""The model's own frontier: the front, the other simulators' data, and one small grid from end to end."""

import numpy as np
import pandas as pd
import pytest

from tilestamp.experiments.frontier import model
from tilestamp.experiments.frontier.model_frames import Timed
from tilestamp.experiments.frontier.model_notes import BOUNDS, COUNTS, FULL
from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.reports.frontier_plot import frontier
from tilestamp.simulator.scenes import load_scene

SIZE = {"width": 96, "height": 72, "tile": 8}


def dominated(points, i):
    """Say by definition whether another point is no worse in both and better in one."""
    cost, error = points[i]
    return any(c <= cost and e <= error and (c < cost or e < error) for c, e in points)


def test_the_front_is_what_no_other_point_dominates():
    points = np.random.default_rng(0).integers(0, 12, (80, 2)).astype(float)
    ours = pareto_front(points[:, 0], points[:, 1])
    assert list(ours) == [not dominated(points.tolist(), i) for i in range(len(points))]


def test_equal_points_stay_on_the_front_together():
    assert pareto_front([1.0, 1.0, 2.0], [3.0, 3.0, 3.0]).tolist() == [True, True, False]


def test_a_point_without_a_number_is_on_no_front():
    assert pareto_front([1.0, np.nan, 2.0], [np.nan, 1.0, 5.0]).tolist() == [False, False, True]


def test_a_plot_takes_points_without_error(tmp_path):
    points = pd.DataFrame(
        {
            "name": ["a", "b", "c"],
            "group": ["x", "x", "y"],
            "cost": [1.0, 10.0, 100.0],
            "error": [5.0, 0.0, 2.0],
            "published": [False, False, True],
            "front": [True, True, False],
        }
    )
    frontier(tmp_path / "plot.png", points, "seconds [s]", "error [%]", "A front")
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_other_simulators_take_instructions_over_speed():
    table = model._detailed(125_000.0).set_index("name")
    assert table.loc["Accel-Sim, traces", "seconds"] == pytest.approx(10.0)


def test_every_figure_of_another_simulator_names_its_source():
    table = model._detailed(1.0)
    assert table.source.str.len().min() > 0
    assert table.mark.str.len().min() > 0
    assert table.speed_mark[table.warp_instructions_per_second.notna()].str.match("published|derived: ").all()
    assert table.speed_mark[table.warp_instructions_per_second.isna()].isna().all()


@pytest.fixture(scope="module")
def result():
    """One small frame through the whole grid."""
    teapot = load_scene("teapot")
    frame = Timed("small", teapot, "micropolygon", "h200", SIZE, lambda run: run.milliseconds, 1.0, "measured")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model, "frames", lambda: [frame])
        patch.setattr(model, "warnings", list)
        return model.run(lambda _: None)


def test_each_way_answers_for_each_frame(result):
    methods = result.tables["frames"].method
    assert methods.is_unique
    assert set(methods) == {FULL, BOUNDS, COUNTS}


def test_the_full_run_is_the_reference(result):
    frames = result.tables["frames"].set_index("method")
    assert frames.loc[FULL, "error_against_full"] == 0.0
    assert frames.loc[FULL, "error_against_known"] == pytest.approx(abs(frames.loc[FULL, "milliseconds"] - 1.0))


def test_auto_lies_between_bounds_and_the_full_run(result):
    frames = result.tables["frames"].set_index("method").milliseconds
    assert frames[BOUNDS] <= frames[FULL] * (1 + 1e-9)


def test_every_way_costs_time(result):
    frames = result.tables["frames"]
    assert (frames.pricing_seconds > 0).all()
    assert (frames.cpu_seconds > frames.pricing_seconds).all()


def test_the_second_chart_has_one_front_over_ours_and_theirs(result):
    beside = model._beside(result.tables["methods"], result.tables["detailed-simulators"])
    assert beside.published.any()
    assert not beside.published.all()
    points = beside[["cost", "error"]].to_numpy().tolist()
    assert list(beside.front) == [not dominated(points, i) for i in range(len(points))]


def test_figures_are_drawn(result, tmp_path):
    for figure in result.figures:
        figure.draw(tmp_path / f"{figure.name}.png")
        assert (tmp_path / f"{figure.name}.png").stat().st_size > 0


def test_notes_say_the_numbers_of_the_tables(result):
    full = result.tables["methods"].set_index("method").loc[FULL]
    assert any(f"{full.cpu_seconds:.2f} s a frame" in note for note in result.notes)
