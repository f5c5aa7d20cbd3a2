"""Experiments on splats: what is read of the measurements, which tile is the fastest, and what the host adds."""

import numpy as np
import pandas as pd
import pytest

from tilestamp.experiments.silicon.splat import fastest_tiles, kernel_names
from tilestamp.experiments.silicon.textured_compare import FRAME_TIME
from tilestamp.experiments.splats.host import host_ms
from tilestamp.experiments.splats.tile_size import measured, winners
from tilestamp.experiments.splats.two_scale import ROADS, SMALL, TWO, best_of_one, by_lists_alone, frames, times
from tilestamp.models.machine import load_machine
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.kerbl2023.duplicate import Pairs
from tilestamp.simulator.stages.kerbl2023.events import SortEvent
from tilestamp.simulator.stages.kerbl2023.sort import RADIX, sort

H200 = load_machine("h200")


def test_the_host_of_an_h200_stops_a_frame_for_as_long_as_measured():
    assert 0.050 < host_ms(H200, 14) < 0.075


def test_a_measured_frame_is_the_one_of_the_table():
    rows = measured().set_index(["scene", "width", "rule", "tile"]).measured
    assert rows["garden1", 1920, "square", 16] == pytest.approx(1.086, abs=0.002)


def test_the_fastest_tile_and_what_another_loses():
    table = pd.DataFrame({"tile": [8, 16, 32], "ms": [2.0, 3.0, 4.0]})
    (row,) = winners(table.assign(scene="s", width=1920, rule="square", machine="m")).to_dict("records")
    assert (row["tile"], row["lost by 16x16"]) == (8, 0.5)


def test_two_scales_are_compared_with_the_better_tile_of_exact_lists():
    table = pd.DataFrame(frames("playbot", load_scene("playbot"), "a100", {"1080p": (160, 96)}))
    assert table.road.tolist() == list(ROADS)
    pairs = table.set_index("road").pairs
    assert pairs[TWO] < pairs[SMALL]
    made = table.assign(ms=[5.0, 3.0, 4.0, 2.0, 1.0])
    assert best_of_one(times(made, "1080p")).tolist() == [1.5]
    blended = made.assign(blend_ms=[3.0, 2.0, 1.5, 0.5, 0.5])
    assert by_lists_alone(blended, "1080p").tolist() == [1.0]


@pytest.mark.parametrize(("second", "clear"), [(1.05, False), (1.2, True)])
def test_a_fastest_tile_is_clear_where_times_differ_by_a_tenth(second, clear):
    rows = [("1920 8x8 square", 9.0, 1.0), ("1920 16x16 square", 8.0, second)]
    table = pd.DataFrame(rows, columns=["config", "ours", "measured"]).assign(scene="s", quantity=FRAME_TIME)
    (row,) = fastest_tiles(table).to_dict("records")
    assert (row["ours"], row["measured"], row["clear"]) == ("16x16", "8x8", clear)
    assert row["lost"] == pytest.approx(second - 1.0)


def test_launches_have_the_published_names():
    run = simulate("playbot", "splat", "h200", width=64, height=48, picture=False)
    names = kernel_names(run.launches)
    assert names[0] == "preprocess"
    assert names[-1] == "render"
    assert [name for name in names if "onesweep" in name] == [f"sort_onesweep_{k}" for k in range(5)]


def _histogram(keys):
    keys = np.array(keys, np.uint64)
    return sort(Pairs(keys, np.zeros(len(keys), np.uint32)), 8, H200.simt).works[0]


def test_a_block_of_the_histogram_adds_each_sector_of_counts_that_is_used():
    assert _histogram([5] * 10).total(SortEvent.ATOMIC_REQUESTS) == 1
    assert _histogram(range(RADIX)).total(SortEvent.ATOMIC_REQUESTS) == RADIX // 8


def test_blocks_of_the_histogram_without_keys_add_nothing():
    work = _histogram([0] * (2048 + 1))
    assert work.table[:, SortEvent.LISTED].sum() == 2
    assert work.table[:, SortEvent.PAIRS].tolist()[:3] == [2048, 1, 0]
    assert work.atomic_requests.tolist()[:2] == [2, 0]
