"""What counting costs: every pipeline with all counters and without, one after the other."""

import pytest

from tests.drawable import seen
from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import load_pipeline, pipeline_names, pipeline_options

SIZE = 800, 600


@pytest.mark.parametrize("counting", [True, False])
@pytest.mark.parametrize("pipeline", pipeline_names())
def test_a_frame(benchmark, timed, pipeline, counting):
    size, simt = SIZE if timed else (64, 48), load_machine("h200").simt
    scene, matrix = seen(pipeline, *size)
    draw, options = load_pipeline(pipeline), pipeline_options(pipeline, {})

    def frame():
        execute = Executor(counting=counting)
        return draw(scene, matrix, *size, simt, options, execute), execute.works

    _, works = benchmark.pedantic(frame, rounds=3, warmup_rounds=1)
    assert bool(works) == counting
