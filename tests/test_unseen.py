"""The out-of-sample table: its scenes are what was measured, and a changed one is noticed."""

import numpy as np

from tilestamp.experiments.silicon import unseen_scenes
from tilestamp.experiments.silicon.unseen import MEASURED
from tilestamp.experiments.silicon.unseen_scenes import DIGESTS, SOUPS, digest_of, write_inputs
from tilestamp.experiments.validation.stored import CUDARASTER, FREEPIPE, read
from tilestamp.models.errors import TilestampError


def test_the_soups_are_those_that_were_drawn():
    assert {name: digest_of(*soup) for name, soup in unseen_scenes._soups().items()} == {
        name: DIGESTS[name] for name in SOUPS
    }


def test_a_scene_that_changed_or_is_missing_is_left_out_with_a_word(tmp_path, monkeypatch):
    def model(name):
        if name == "cow":
            raise TilestampError("no such file")
        return np.zeros((3, 4), np.float32), np.zeros((1, 3), np.int32)

    monkeypatch.setattr(unseen_scenes, "_model", model)
    left_out = write_inputs(tmp_path)
    assert len(left_out) == len(DIGESTS) - len(SOUPS)
    assert "cow is left out: no such file" in left_out
    assert {path.name.removesuffix("_input.npz") for path in (tmp_path / "ids").iterdir()} == set(SOUPS)


def test_every_measured_scene_is_defined_and_no_value_is_missing():
    for name in (CUDARASTER, FREEPIPE):
        values = read(MEASURED / name)
        assert {key[0] for key in values} == set(DIGESTS)
        assert all(np.isfinite(value) for value in values.values())
