"""The out-of-sample table: its scenes are what was measured, and a changed one is noticed."""

import numpy as np
import pytest

from tilestamp.experiments.silicon import unseen_scenes as unseen_module
from tilestamp.experiments.silicon.inputs import digest_of, write_inputs
from tilestamp.experiments.silicon.seen_scenes import DIGESTS as SEEN_DIGESTS
from tilestamp.experiments.silicon.seen_scenes import MODELS, SEEN, seen_scenes
from tilestamp.experiments.silicon.unseen import MEASURED
from tilestamp.experiments.silicon.unseen_scenes import DIGESTS, SOUPS, unseen_scenes
from tilestamp.experiments.validation.stored import CUDARASTER, FREEPIPE, read
from tilestamp.models.errors import TilestampError


def test_the_soups_are_those_that_were_drawn():
    assert {name: digest_of(*soup) for name, soup in unseen_module._soups().items()} == {
        name: DIGESTS[name] for name in SOUPS
    }


def test_a_scene_that_changed_or_is_missing_is_left_out_with_a_word(tmp_path, monkeypatch):
    def model(name):
        if name == "cow":
            raise TilestampError("no such file")
        return np.zeros((3, 4), np.float32), np.zeros((1, 3), np.int32)

    monkeypatch.setattr(unseen_module, "_model", model)
    left_out = write_inputs(tmp_path, unseen_scenes())
    assert len(left_out) == len(DIGESTS) - len(SOUPS)
    assert "cow is left out: no such file" in left_out
    assert {path.name.removesuffix("_input.npz") for path in (tmp_path / "ids").iterdir()} == set(SOUPS)


def test_every_measured_scene_is_defined_and_no_value_is_missing():
    for name in (CUDARASTER, FREEPIPE):
        values = read(MEASURED / name)
        assert {key[0] for key in values} == set(DIGESTS)
        assert all(np.isfinite(value) for value in values.values())


def test_the_package_holds_the_triangles_of_all_seen_scenes_but_two_models(tmp_path, monkeypatch):
    monkeypatch.setenv("TILESTAMP_SCENES", "")
    left_out = write_inputs(tmp_path, seen_scenes())
    written = {path.name.removesuffix("_input.npz") for path in (tmp_path / "ids").iterdir()}
    assert written == set(SEEN_DIGESTS) - set(MODELS)
    assert len(left_out) == len(MODELS)
    assert all(name in said for name, said in zip(MODELS, left_out, strict=True))


def test_every_seen_scene_was_measured():
    for name in (CUDARASTER, FREEPIPE):
        assert {key[0] for key in read(SEEN / name)} == set(SEEN_DIGESTS)


@pytest.mark.shared
def test_the_models_and_their_measured_camera_are_what_was_drawn_to_a_few_units_in_the_last_place(shared):
    for name, (_, make) in seen_scenes().items():
        positions, triangles = make()
        with np.load(shared / "silicon" / "ids" / f"{name}_input.npz") as drawn:
            theirs = drawn["positions"][drawn["triangles"]]
        assert np.abs(positions[triangles] - theirs).max() <= 3 * np.spacing(np.abs(theirs).max())
