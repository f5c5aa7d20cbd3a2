"""Stages that run in part: the rows of some units are the rows that those units have in the whole."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drawable import seen
from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import load_pipeline, pipeline_names, pipeline_options
from tilestamp.simulator.stage import StageResult

SIZE = 100, 75  # no multiple of a tile
CASES = [  # every stage that a pipeline lets run in part, by its options
    ("micropolygon", "gtx280", {}),
    ("micropolygon", "gtx480", {"edges": "loaded", "tile": 4}),
    ("micropolygon", "h200", {"spp": 4, "tile": 16, "box_tests": False}),
    ("cudaraster", "gtx480", {}),
    ("cudaraster", "h200", {"release": "nvdiffrast"}),
    ("cudaraster", "gtx480", {"msaa": 4, "mode": "blend"}),
]


class Last(Executor):
    """Keeps the stage of which an executor may run a part, and its inputs."""

    stage: Any = None

    def last(self, stage: Any, *inputs: Any, **options: Any) -> StageResult[Any]:
        """Note the stage, and run it."""
        self.stage, self.named = stage, stage.inputs(*inputs, **options)
        return super().last(stage, *inputs, **options)


@cache
def whole(case: int) -> tuple[Any, dict[str, Any], np.ndarray]:
    """Stage, inputs, and the rows of all units."""
    pipeline, machine, options = CASES[case]
    execute, simt = Last(), load_machine(machine).simt
    load_pipeline(pipeline)(*seen(pipeline, *SIZE), *SIZE, simt, pipeline_options(pipeline, options), execute)
    return execute.stage, execute.named, execute.stage.run(**execute.named)[1]


def test_every_pipeline_with_a_stage_that_runs_in_part_is_here():
    found = set()
    for name in pipeline_names():
        execute, simt = Last(), load_machine("h200").simt
        load_pipeline(name)(*seen(name, *SIZE), *SIZE, simt, pipeline_options(name, {}), execute)
        found |= {name} if execute.stage is not None else set()
    assert found == {pipeline for pipeline, _, _ in CASES}


@pytest.mark.parametrize("case", range(len(CASES)))
@settings(max_examples=10, deadline=None)
@given(st.data())
def test_rows_of_a_part_equal_the_same_rows_of_the_whole(case, data):
    stage, named, rows = whole(case)
    units = np.array(data.draw(st.lists(st.integers(0, len(rows) - 1), unique=True, max_size=40)), np.int64)
    assert (stage.run(**named, units=units)[1] == rows[units]).all()


@pytest.mark.parametrize("case", range(len(CASES)))
def test_what_is_known_exactly_is_what_the_whole_does(case):
    stage, named, rows = whole(case)
    known = stage.known(**named)
    assert known.exact
    for event, column in known.exact.items():
        assert (rows[:, event] == column).all(), event


@pytest.mark.parametrize("case", range(len(CASES)))
def test_what_is_known_has_a_number_for_each_unit(case):
    stage, named, rows = whole(case)
    known = stage.known(**named)
    assert known.seconds > 0
    assert all(len(column) == len(rows) for column in (known.size, *known.more))
    assert (known.size[rows.any(axis=1)] >= 0).all()


@pytest.mark.parametrize("case", range(len(CASES)))
def test_a_part_changes_none_of_its_inputs(case):
    stage, named, rows = whole(case)
    stage.run(**named, units=np.arange(3))
    assert (stage.run(**named)[1] == rows).all()
