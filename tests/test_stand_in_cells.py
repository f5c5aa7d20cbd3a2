"""Cells of a stand-in have a status of their own."""

from dataclasses import replace

from tests.stored_results import CELL, RESULT
from tilestamp.simulator.scenes.library import stand_in
from tilestamp.simulator.scenes.search_path import FILES, SCENES_VARIABLE


def test_cells_of_a_stand_in_are_neither_predicted_nor_fitted_nor_missed():
    from tilestamp.experiments.harness.fit import run_judged

    def run(_say):
        stand_in("bigguy")
        cells = [
            replace(CELL, row="here", frame="teapot 64x48"),
            replace(CELL, row="absent", ours=99.0, frame="bigguy 64x48"),
            replace(CELL, row="said", frame="bigguy 64x48", status="reported"),
            replace(CELL, row="made of it", of=(("absent", "column"),)),
        ]
        return replace(RESULT, cells=cells)

    cells = run_judged(run, lambda _: None)[0].cells
    assert [cell.status for cell in cells] == ["predicted", "stand-in", "stand-in", "stand-in"]
    assert not any(cell.missed for cell in cells)


def test_cells_of_a_stand_in_name_no_fitted_numbers():
    from tilestamp.experiments.harness.fit import run_judged
    from tilestamp.models.fitted import Fitted

    number = Fitted("gpu: clock", 2.0, ("bigguy 64x48",))

    def run(_say):
        stand_in("bigguy")
        return replace(RESULT, cells=[replace(CELL, ours=5 * number.value, frame="bigguy 64x48")])

    (cell,) = run_judged(run, lambda _: None)[0].cells
    assert (cell.share, cell.fitted_by) == (0.0, ())


def test_a_model_that_is_remembered_is_noted_again(monkeypatch, tmp_path):
    from tilestamp.experiments.eisenacher2010.frames import model
    from tilestamp.models.used import collect

    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path))
    model("bigguy")
    with collect() as used:
        model("bigguy")
    assert "bigguy" in used[FILES]
