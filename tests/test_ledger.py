"""Counts, prices and reported figures are those of the ledger; where one is meant to change, write it anew."""

import importlib
import pkgutil
from enum import IntEnum

import pytest

from tests.ledger import book, cells, runs
from tilestamp.simulator import stages
from tilestamp.simulator.pipelines import pipeline_names

HINT = "where that is meant: python -m tests.ledger, and say why in the commit"
SHOWN = 30


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_counts_and_prices_of_small_frames_are_those_of_the_ledger(pipeline):
    found = book.differences(book.read(book.FOLDER / "frames" / f"{pipeline}.csv"), runs.entries(pipeline))
    assert not found, "\n".join([f"{len(found)} numbers differ", *found[:SHOWN], HINT])


@pytest.mark.shared
@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in cells.QUICK else pytest.mark.cells) for name in cells.experiments()]
)
def test_cells_of_experiments_are_those_of_the_ledger(name):
    path = book.FOLDER / "cells" / f"{cells.file_name(name)}.csv"
    assert path.exists(), f"not in the ledger yet: python -m tests.ledger --cells {name}"
    found = book.differences(book.read(path), cells.entries(name))
    assert not found, "\n".join(
        [f"{len(found)} cells differ", *found[:SHOWN], HINT.replace("ledger,", "ledger --cells,")]
    )


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_every_event_of_a_pipeline_occurs_in_the_ledger(pipeline):
    """Else no frame of the ledger would tell of a change in it."""
    assert runs.silent_events(pipeline) == set()


def test_every_stage_is_run_in_the_ledger():
    run = {kind for pipeline in pipeline_names() for kind in runs.event_kinds(pipeline)}
    assert _event_kinds() - run == set()


def _event_kinds() -> set[str]:
    """Names of all enums of events of the stages."""
    found = pkgutil.walk_packages(stages.__path__, f"{stages.__name__}.")
    values = [value for module in found for value in vars(importlib.import_module(module.name)).values()]
    kinds = {value.__name__ for value in values if isinstance(value, type) and issubclass(value, IntEnum)}
    return {kind for kind in kinds if kind.endswith("Event")} - {"MachineEvent"}


def test_a_count_that_changes_by_one_is_seen():
    held = {("frame", "kernel", "count HITS"): "100000"}
    assert book.differences(held, {("frame", "kernel", "count HITS"): "100001"}) == [
        "frame / kernel / count HITS: 100000 -> 100001 (+0.001 %)"
    ]


def test_a_time_may_differ_by_a_thousandth():
    held = {("frame", "kernel", "time ms"): "1.0"}
    assert not book.differences(held, {("frame", "kernel", "time ms"): "1.0009"})
    assert book.differences(held, {("frame", "kernel", "time ms"): "1.0011"})


def test_what_is_missing_or_new_is_seen():
    assert book.differences({("a",): "1"}, {("b",): "1"}) == ["a: no longer there", "b: new, 1"]


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_every_price_of_a_pipeline_is_paid_in_the_ledger(pipeline):
    """Else no frame of the ledger would tell of a change in it."""
    assert runs.unpaid(pipeline) == []
