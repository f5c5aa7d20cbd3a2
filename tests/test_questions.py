"""Questions to a study: the best over a plane, fronts, effects, searches."""

import sys

import numpy as np
import pandas as pd
import pytest

from tilestamp import Study, TilestampError, load_machine
from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.registry import experiment_names
from tilestamp.experiments.questions import answers
from tilestamp.experiments.questions.best import best_values, boundaries
from tilestamp.experiments.questions.effects import screen, sobol
from tilestamp.experiments.questions.search import search
from tilestamp.experiments.questions.space import Space, values_at
from tilestamp.experiments.studies.area import L2_MB, area, sm_area
from tilestamp.models.machine import altered

TINY = {"scene": "teapot", "size": "64x48", "machine": "h200"}
CHIP = {"sm.count": {"from": 10, "to": 210, "points": 2}, "memory.l2_bytes": {"from": 0, "to": 1 << 28, "points": 2}}
TIMES = pd.DataFrame(
    {
        "zoom": [1.0, 1.0, 4.0, 4.0, 16.0, 16.0],
        "tile": [4, 8, 4, 8, 4, 8],
        "milliseconds": [1.0, 4.0, 2.0, 1.0, 8.0, np.nan],
    }
)


def test_the_best_has_the_least_time_and_its_margin_over_the_second():
    found = best_values(TIMES, "tile", ["zoom"])
    assert found["best"].tolist() == [4, 8, 4]
    assert found["second"].tolist()[:2] == [8, 4]
    assert found["margin"].tolist()[:2] == [3.0, 1.0]


def test_what_has_no_time_is_not_the_best_and_no_second():
    last = best_values(TIMES, "tile", ["zoom"]).iloc[2]
    assert last["best"] == 4
    assert np.isnan(last["margin"])
    assert pd.isna(last["second"])


def test_a_boundary_lies_where_both_take_as_long():
    first, second = boundaries(TIMES, "tile", "zoom", [])
    assert (first.before, first.after, first.at) == (
        4,
        8,
        pytest.approx(4 ** (2 / 3)),
    )  # the ratio is 1/4 at 1, and 2 at 4
    assert (second.before, second.after, second.at) == (8, 4, pytest.approx(8.0))  # the middle: no time at 16


def test_boundaries_are_found_at_each_place_of_the_other_axes():
    both = pd.concat([TIMES.assign(machine="a"), TIMES.assign(machine="b", zoom=10 * TIMES["zoom"])])
    found = boundaries(both, "tile", "zoom", ["machine"])
    assert [(one.place["machine"], round(one.at, 2)) for one in found] == [
        ("a", 2.52),
        ("a", 8),
        ("b", 25.2),
        ("b", 80),
    ]


def test_the_best_over_a_plane_agrees_with_the_table():
    grid = {"tile": [4, 8, 16], "zoom": [1, 3], "machine": ["gtx280", "h200"]}
    study = Study(fixed={"scene": "teapot", "size": "64x48"}, grid=grid)
    found = answers.best(study, "tile", ["zoom", "machine"]).table
    cells = study.table()
    for row in found.itertuples():
        times = cells[(cells.zoom == row.zoom) & (cells.machine == row.machine)].set_index("tile").milliseconds
        assert row.best == times.idxmin()
        assert row.margin == pytest.approx(times.nsmallest(2).iloc[1] / times.min() - 1)


@pytest.mark.parametrize(
    ("axis", "over", "said"),
    [
        ("tyle", ["zoom", "spp"], "no axis tyle .did you mean .tile"),
        ("tile", ["zoom"], "a plane has two axes"),
        ("tile", ["tile", "zoom"], "are different ones"),
        ("tile", ["zoom", "spp"], "make 13 maps"),
    ],
)
def test_a_plane_that_is_none_is_a_sentence(axis, over, said, monkeypatch):
    monkeypatch.setattr(answers, "_run", lambda study, *_: _cells_of(study))
    orbit = {"from": 0, "to": 120, "points": 13}
    study = Study(fixed=TINY, grid={"tile": [4, 8], "zoom": [1, 2], "spp": [1, 4], "orbit": orbit})
    with pytest.raises(TilestampError, match=said):
        answers.best(study, axis, over)


def _cells_of(study):
    index = pd.MultiIndex.from_product(study.axes.values(), names=study.axes)
    return pd.DataFrame({"milliseconds": 1.0}, index=index).reset_index()


def test_the_front_has_what_nothing_beats_in_both():
    study = Study(fixed=TINY, grid={"sm.count": [1, 2, 132], "times.sm.clock_mhz": [0.5, 1.0]})
    found = answers.front(study, "milliseconds", "area").table
    assert set(found["times.sm.clock_mhz"]) == {1.0}  # a clock costs no area
    assert 1 in set(found["sm.count"])
    assert found["area"].is_monotonic_decreasing


def test_words_make_no_front():
    study = Study(fixed=TINY, grid={"tile": [4, 8]})
    with pytest.raises(TilestampError, match="bound is no number"):
        answers.front(study, "bound", "milliseconds")


def test_a_space_goes_from_end_to_end_and_through_all_values_of_a_list():
    study = Study(
        fixed=TINY,
        grid={"zoom": {"from": 1, "to": 4, "points": 2, "scale": "log"}, "tile": [4, 8]},
        sample={"points": 2, "axes": {"sm.count": {"from": 10, "to": 13}}},
    )
    points = Space(study).points([[0, 0, 0], [0.5, 0.49, 0.5], [1, 0.5, 1]])
    assert [point["zoom"] for point in points] == pytest.approx([1, 2, 4])
    assert [point["tile"] for point in points] == [4, 4, 8]
    assert [point["sm.count"] for point in points] == [10, 12, 13]


def test_axes_walked_together_are_no_space():
    with pytest.raises(TilestampError, match="are no space"):
        Space(Study(fixed=TINY, zip={"tile": [4, 8], "spp": [1, 4]}))


def test_sobol_shares_of_a_sum_are_those_of_its_variances():
    pytest.importorskip("SALib")
    one, many = (altered(load_machine("h200"), {"sm.count": count}) for count in (10, 210))
    spans = {"sm.count": area(many) - area(one), "memory.l2_bytes": 256 * L2_MB}
    table = sobol(Study(fixed=TINY, grid=CHIP), "area", 256).set_index("axis")
    logarithms = np.log(
        area(one) - 60 * L2_MB + sum(span * share for span, share in zip(spans.values(), _cube(), strict=True))
    )
    for share, name in zip(_cube(), spans, strict=True):
        bins = [logarithms[(share >= low) & (share < low + 0.02)].mean() for low in np.arange(0, 1, 0.02)]
        assert table.alone[name] == pytest.approx(np.var(bins) / np.var(logarithms), abs=0.08)
    assert table.index[0] == "sm.count"


def _cube():
    return np.random.default_rng(3).random((2, 100_000))


def test_screening_gives_the_factor_across_an_axis_and_none_of_what_has_no_effect():
    pytest.importorskip("SALib")
    axes = {"sm.count": CHIP["sm.count"], "sm.clock_mhz": {"from": 1000, "to": 2000, "points": 2}}
    table, is_factor = screen(Study(fixed=TINY, grid=axes), "area", walks=4)
    assert is_factor
    effects = table.set_index("axis").effect
    assert effects["sm.clock_mhz"] == 1.0
    assert table.axis[0] == "sm.count"
    at = [area(altered(load_machine("h200"), {"sm.count": count})) for count in (10, 77, 143, 210)]
    steps = [(at[last] / at[first]) ** 1.5 for first, last in ((0, 2), (1, 3))]  # two thirds of the way each
    assert min(steps) <= effects["sm.count"] <= max(steps)


@pytest.mark.parametrize("ask", [lambda study: sobol(study, points=6), lambda study: screen(study, walks=1)])
def test_numbers_of_points_that_do_not_do_are_a_sentence(ask):
    pytest.importorskip("SALib")
    with pytest.raises(TilestampError, match="needs"):
        ask(Study(fixed=TINY, grid=CHIP))


def test_cells_without_a_number_are_said_with_their_problem():
    pytest.importorskip("SALib")
    study = Study(fixed=TINY, grid={"tile": [8, 32], "sm.max_threads_per_block": [256, 1024]})
    with pytest.raises(TilestampError, match=r"cells have no milliseconds \(.*: narrow the axes"):
        screen(study, walks=4)


def test_a_search_finds_the_least_and_asks_for_the_same_cells_again(tmp_path):
    pytest.importorskip("optuna")
    study = Study(fixed=TINY, grid=CHIP, store=tmp_path / "chip.sqlite")
    found = search(study, ["area"], cells=40)
    assert len(found) == 40
    assert found.loc[found.best, "area"].tolist() == [found.area.min()]
    assert found.area[16:].mean() < 0.6 * found.area[:16].mean()  # the first 16 are at random
    kept = len(study.kept)
    pd.testing.assert_frame_equal(search(study, ["area"], cells=40), found)
    assert len(study.kept) == kept


def test_a_search_for_two_numbers_gives_their_front():
    pytest.importorskip("optuna")
    found = search(Study(fixed=TINY, grid=CHIP), ["milliseconds", "area"], cells=16)
    for row in found.itertuples():
        beaten = ((found.milliseconds <= row.milliseconds) & (found.area < row.area)) | (
            (found.milliseconds < row.milliseconds) & (found.area <= row.area)
        )
        assert row.best == (not beaten.any())


def test_a_search_goes_round_cells_that_have_no_time():
    pytest.importorskip("optuna")
    study = Study(fixed={**TINY, "sm.max_threads_per_block": 256}, grid={"tile": [8, 32]})
    found = search(study, cells=12)
    assert set(found.loc[found.tile == 32, "milliseconds"].isna()) == {True}
    assert set(found.loc[found.best, "tile"]) == {8}


@pytest.mark.parametrize(
    ("library", "question"), [("SALib.sample", screen), ("SALib.sample", sobol), ("optuna", search)]
)
def test_a_library_that_is_missing_is_a_sentence(library, question, monkeypatch):
    for name in [name for name in sys.modules if name.startswith(library)]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(TilestampError, match=r"pip install 'tilestamp\[study\]'"):
        question(Study(fixed=TINY, grid=CHIP))


def test_cells_that_fail_are_no_answer(monkeypatch):
    monkeypatch.setattr(Study, "at", lambda *_: pd.DataFrame({"milliseconds": [1.0]}))
    with pytest.raises(TilestampError, match="1 of 2 cells failed"):
        values_at(Study(fixed=TINY), [{"tile": 4}, {"tile": 8}], ["milliseconds"])


def test_the_area_is_that_of_the_sms_and_of_the_l2():
    machine = load_machine("h200")
    assert area(machine) == pytest.approx(132 * sm_area(machine) + 60 * L2_MB)
    wider = altered(machine, {"pipe.fp32": machine.pipe.fp32 / 2, "sm.registers": 2 * machine.sm.registers})
    lanes = machine.sm.warp_size / machine.pipe.fp32
    assert sm_area(wider) - sm_area(machine) == pytest.approx(4 * 0.004 * lanes + 0.25)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "chip.toml"
    path.write_text(
        '[fixed]\nscene = "teapot"\nsize = "64x48"\nmachine = "h200"\n'
        '[grid]\ntile = [4, 8]\nzoom = [1, 2]\n"sm.count" = { from = 10, to = 100, points = 2 }\n'
    )
    return path


@pytest.mark.parametrize(
    ("question", "said"),
    [
        (["best", "FILE", "tile", "--over", "zoom,sm.count"], "Best of 4 places"),
        (["front", "FILE", "milliseconds", "area"], "Nothing else of 8 cells"),
        (["screen", "FILE", "area", "--walks", "2"], "Mean factor of area"),
        (["sobol", "FILE", "area", "--points", "8"], "Share of the variance of area"),
        (["search", "FILE", "--cells", "4"], "The best of 4 cells"),
    ],
)
def test_a_question_on_the_command_line_has_a_sentence_and_a_picture(question, said, file, tmp_path, capsys):
    for library in ("SALib", "optuna"):
        pytest.importorskip(library)
    picture = tmp_path / "answer.png"
    words = [str(file) if word == "FILE" else word for word in question]
    assert run_command(["ask", *words, "-o", str(picture)]) == 0
    assert said in capsys.readouterr().out
    assert picture.stat().st_size > 5000


def test_a_slip_in_a_study_that_is_asked_has_its_line(file, capsys):
    file.write_text(file.read_text().replace("zoom = [1, 2]", "zoom = [1, 0]"))
    assert run_command(["ask", "best", str(file), "tile", "--over", "zoom,sm.count"]) == 2
    assert "chip.toml:7: zoom" in capsys.readouterr().err


def test_the_runner_of_studies_is_no_experiment():
    assert "studies/runner" not in experiment_names()


def test_labels_of_a_front_have_a_clock_in_full():
    assert answers._short(1970.7) == "1971"
