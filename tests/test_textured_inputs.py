"""Inputs and measurements of the textured rasterizers: what is read, and what is said where there are none."""

import pytest

from tilestamp.experiments.silicon.textured_inputs import VARIABLE, measured_scenes, read_measured
from tilestamp.models.errors import MissingInputError


@pytest.fixture
def duck(shared, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(shared / "silicon/textured"))
    return read_measured("ru_Duck_fit")


def test_without_a_folder_it_says_which_variable_names_it(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(MissingInputError, match=VARIABLE):
        measured_scenes("ru")


def test_a_scene_is_what_the_kernels_got(duck):
    assert (len(duck.scene.mesh.positions), len(duck.scene.mesh.triangles)) == (2399, 4212)
    assert [texture.shape for texture in duck.scene.mesh.textures] == [(512, 512, 4)]


def test_times_are_the_mean_of_two_runs(duck):
    assert duck.on_gpu["tiled_t8_cull_original", "tileBasedRasterize", 0, "us_median"] == pytest.approx(58.96)


def test_only_frames_that_were_timed_are_configurations(duck):
    assert "tiled_t8_cull_original" in duck.configs
    assert not {"vertex", "tiled_t8_cull", "scene"} & set(duck.configs)
