"""Counters: what a stage declares beside its events is what reports show, and nothing else has to be edited."""

import json
from enum import IntEnum

import numpy as np
import pytest

from tilestamp import simulate
from tilestamp.experiments.commands.render_output import as_json, print_run
from tilestamp.models.counters import by_name, count, counters_of, distribution, ratio, shown, size
from tilestamp.models.machine import load_machine
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.run import Run
from tilestamp.simulator.stage_table import declared, declared_columns
from tilestamp.simulator.work import Work


@shown(
    count("TRIES", "tries"),
    size("MOVED", "bytes moved"),
    ratio("luck", "HITS", "TRIES", "tries that hit"),
    distribution("load", "TRIES", "tries of a unit"),
)
class LuckEvent(IntEnum):
    """Events of a stage that exists here alone."""

    WARPS = 0
    TRIES = 1
    HITS = 2
    MOVED = 3


class SilentEvent(IntEnum):
    """Events that reports do not show."""

    WARPS = 0


def luck(*rows, events=LuckEvent, stage="luck"):
    table = np.array(rows, np.int64).reshape(-1, len(events))
    return Work(stage, events, table, 64, kernel="draw")


MIX = """
[draw]
registers = 16
provenance = "assumed"
source = "a test"

[draw.WARPS]
fp32 = 4
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of two stages of ours."""
    folder = tmp_path_factory.mktemp("mixes")
    (folder / "lucky").mkdir()
    (folder / "lucky" / "cc2.toml").write_text(MIX)
    works = [luck([1, 10, 2, 64], [1, 30, 8, 0]), luck([1], events=SilentEvent, stage="silent")]
    frame = Frame.numbers(works, {})
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("tilestamp.simulator.mix.MIXES", folder)
        made = Run("nothing", "lucky", load_machine("gtx480"), 32, 24, "bounds", {}, frame)
        _ = made.stages
    return made


def test_what_a_stage_declares_is_a_column_of_the_stages(run):
    row = run.stages.loc["luck"]
    assert (row.tries, row.moved, row.luck, row.load_mean, row.load_max) == (40, 64, 0.25, 20, 30)


def test_a_stage_that_does_not_declare_it_has_no_sum_and_no_ratio(run):
    row = run.stages.loc["silent"]
    assert (row.tries, row.moved) == (0, 0)
    assert np.isnan([row.luck, row.load_mean, row.load_max]).all()


def test_only_what_is_declared_is_shown(run):
    assert not {"hits", "warps_", "ste", "sample_tests"} & set(run.stages)


def test_what_a_stage_declares_is_in_the_json_with_title_and_kind(run):
    told = json.loads(json.dumps(as_json(run)))
    assert told["stages"]["luck"]["luck"] == 0.25
    assert told["counters"]["luck"] == {"title": "tries that hit", "kind": "ratio"}
    assert list(told["counters"]) == ["tries", "moved", "luck", "load"]


def test_what_a_stage_declares_is_in_the_printed_table(run, capsys):
    print_run(run, None)
    printed = capsys.readouterr().out.splitlines()
    assert {"tries", "moved", "luck", "load_mean", "load_max"} <= set(printed[1].split())
    assert {"40", "64", "0.2500", "20.0", "30.0"} <= set(printed[2].split())


def test_two_stages_may_mean_different_events_by_one_name():
    @shown(count("HITS", "tries by another name", "tries"))
    class OtherEvent(IntEnum):
        HITS = 0

    works = [luck([1, 10, 2, 64]), luck([7], events=OtherEvent, stage="other")]
    assert declared(works)["tries"].title == "tries"
    assert [declared_columns([work], declared(works))["tries"] for work in works] == [10, 7]


def test_the_launches_of_a_stage_are_one_distribution():
    (counter,) = (c for c in counters_of(LuckEvent) if c.kind == "distribution")
    found = counter.values({}, [np.array([1, 2]), np.array([9])])
    assert found == {"load_mean": 4.0, "load_max": 9.0}


def test_a_ratio_of_nothing_is_no_number():
    assert np.isnan(ratio("luck", "HITS", "TRIES", "").values({"HITS": 0, "TRIES": 0}, [])["luck"])


def test_a_counter_of_an_event_that_is_not_counted_cannot_bedeclared_columns():
    with pytest.raises(KeyError, match="GHOSTS"):
        shown(count("GHOSTS", "ghosts"))(SilentEvent)


def test_of_one_name_the_first_stands():
    first, second = count("A", "first", "same"), count("B", "second", "same")
    assert by_name([first, second]) == {"same": first}


def test_sample_test_efficiency_is_a_declared_ratio():
    run = simulate("teapot", "stamps", "gtx280", width=48, height=36, fidelity="bounds")
    ste = run.counters["ste"]
    assert (ste.kind, ste.events) == ("ratio", ("SAMPLE_HITS", "SAMPLE_TESTS"))
    assert run.stages.loc["stamps", "ste"] == run.counts["stamps.SAMPLE_HITS"] / run.counts["stamps.SAMPLE_TESTS"]


def test_a_fact_that_counts_nothing_has_no_remark():
    sentences = {"lost": "{:,} are lost", "kept": "{:,} are kept"}
    assert remarks(sentences, {"lost": 1200, "kept": 0}) == ("1,200 are lost",)
