"""How long until there is something to see: commands in processes of their own, compiled and not."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.drawable import scene_for
from tilestamp.simulator.pipelines import pipeline_names

RENDER = "render", "teapot"


def command(*words, **environment):
    """Run a command of tilestamp."""
    line = [sys.executable, "-m", "tilestamp", *words]
    return subprocess.run(line, env=os.environ | environment, capture_output=True, text=True, check=True).stdout  # noqa: S603 - our own command


@pytest.mark.parametrize("words", [RENDER, ("--version",), ("--help",), ("list", "pipelines")], ids=" ".join)
def test_a_command_that_is_compiled(benchmark, words):
    assert benchmark.pedantic(command, words, rounds=5, warmup_rounds=1)


@pytest.fixture(scope="module")
def empty(timed, tmp_path_factory):
    """Give the function that makes an empty cache; where no clock runs, skip: CI begins with compiling all."""
    if not timed:
        pytest.skip("compiles all kernels, as CI does at its start")
    return lambda: {"NUMBA_CACHE_DIR": str(tmp_path_factory.mktemp("kernels"))}


@pytest.fixture(scope="module")
def of_another(empty):
    """Give a cache with the kernels of micropolygon."""
    folder = empty()
    command(*RENDER, **folder)
    return folder["NUMBA_CACHE_DIR"]


def test_the_first_picture_from_an_empty_cache(benchmark, empty):
    assert benchmark.pedantic(lambda folder: command(*RENDER, **folder), setup=lambda: ((empty(),), {}), rounds=2)


@pytest.mark.parametrize("pipeline", sorted({*pipeline_names()} - {"micropolygon"}))
def test_a_further_pipeline_from_the_cache_of_another(benchmark, empty, of_another, pipeline):
    folder = empty()
    shutil.copytree(of_another, folder["NUMBA_CACHE_DIR"], dirs_exist_ok=True)
    assert benchmark.pedantic(command, ("render", scene_for(pipeline), "--pipeline", pipeline), folder, rounds=1)
