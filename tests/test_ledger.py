"""Counts, prices and reported figures are those of the ledger; where one is meant to change, write it anew."""

import pytest

from tests.ledger import book, frames
from tilestamp.simulator.pipelines import pipeline_names

HINT = "where that is meant: python -m tests.ledger, and say why in the commit"
SHOWN = 30


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_counts_and_prices_of_small_frames_are_those_of_the_ledger(pipeline):
    found = book.differences(book.read(book.FOLDER / "frames" / f"{pipeline}.csv"), frames.entries(pipeline))
    assert not found, "\n".join([f"{len(found)} numbers differ", *found[:SHOWN], HINT])


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
