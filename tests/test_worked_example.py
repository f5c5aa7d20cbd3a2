"""The worked example of docs/extending.md runs as it stands there, and its counter shows in the report."""

import json
import re
import sys
from pathlib import Path

import pytest

from tilestamp import simulate
from tilestamp.experiments.command_line import run_command
from tilestamp.simulator import mix, pipelines

PAGE = Path(__file__).parent.parent / "docs" / "extending.md"
SIZE = {"width": 64, "height": 48}


@pytest.fixture(autouse=True)
def _example(tmp_path, monkeypatch):
    """The blocks of the page, as a pipeline and its mix."""
    section = PAGE.read_text("utf-8").split("## A worked example")[1].split("\n## ")[0]
    code, prices = (re.search(rf"```{kind}\n(.*?)```", section, re.DOTALL)[1] for kind in ("python", "toml"))
    (tmp_path / "points").mkdir()
    (tmp_path / "points.py").write_text(code)
    (tmp_path / "points" / "cc2.toml").write_text(prices)
    monkeypatch.setattr(pipelines, "__path__", [*pipelines.__path__, str(tmp_path)])
    monkeypatch.setattr(mix, "MIXES", tmp_path)
    mix.load_mix.cache_clear()
    yield
    mix.load_mix.cache_clear()
    sys.modules.pop("tilestamp.simulator.pipelines.points", None)


def test_the_example_is_priced_and_its_counter_shown():
    run = simulate("teapot", "points", "gtx480", **SIZE)
    assert run.stages.index.tolist() == ["project", "splat"]
    assert (run.stages["milliseconds"] > 0).all()
    assert 0 < run.stages.loc["splat", "hidden"] < 1
    assert run.stages.loc["splat", "hidden"] == run.counts["splat.BEHIND"] / run.counts["splat.POINTS"]


def test_every_point_that_is_not_behind_another_has_a_pixel_or_was_first_there():
    run = simulate("teapot", "points", "gtx480", **SIZE)
    drawn = int((run.image[..., 0] > 0).sum())
    assert drawn <= run.counts["splat.POINTS"] - run.counts["splat.BEHIND"]
    assert run.counts["splat.WARPS"] == -(-len(_vertices()) // 32)


def test_the_command_line_knows_it(capsys):
    assert (
        run_command(["render", "teapot", "--pipeline", "points", "--machine", "gtx480", "--size", "64x48", "--json"])
        == 0
    )
    stages = json.loads(capsys.readouterr().out)["stages"]
    assert "hidden" in json.dumps(stages)


def _vertices():
    from tilestamp import load_scene
    from tilestamp.simulator.stages.vertex_transform import triangle_mesh

    return triangle_mesh(load_scene("teapot")).positions
