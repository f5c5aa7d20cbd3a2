"""Lines that were stored with gaps: who fills them up, and what it takes on the H200 (measured/l2_gaps.csv)."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tests.pricing import bounds
from tilestamp.models.events import EVENTS
from tilestamp.models.gap_lines import GapLines
from tilestamp.models.launch import LINE_BYTES, Launch, Stream
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.models.traffic import Traffic, traffic

H200 = load_machine("h200")
MEASURED = Path(__file__).parent.parent / "experiments/silicon/measured/l2_gaps.csv"
MB = 10**6


def launch(*streams):
    return Launch(
        stage="stage", kernel="kernel", grid=1, block=32, registers=16, shared_bytes=0,
        events=np.zeros((1, EVENTS)), streams=streams,
    )  # fmt: skip


def store(buffer, size, *, gaps=False):
    return launch(Stream(buffer, "store", size, size, partial_lines=0, gaps=gaps))


def measured(group, case, metric):
    with MEASURED.open() as file:
        return {
            float(row["mib"]): float(row["value"])
            for row in csv.DictReader(file)
            if (row["group"], row["case"], row["metric"]) == (group, case, metric)
        }


def test_lines_beyond_their_part_of_l2_are_filled_at_once():
    assert GapLines(1000, 200).run(0, 200 + 3 * LINE_BYTES) == 3


def test_what_comes_in_fills_them_in_proportion():
    lines = GapLines(1000, 640)
    lines.run(0, 640)
    assert [lines.run(brought, 0) for brought in (200, 400, 0, 800, 800)] == [1, 2, 0, 2, 0]


def test_the_next_frame_stores_over_what_is_left():
    lines = GapLines(1000, 640)
    assert [lines.run(0, 640) for _ in range(3)] == [0, 0, 0]


def test_lines_of_a_buffer_that_two_streams_store_with_gaps_are_filled_once():
    gaps = Stream("a", "store", 40 * MB, 40 * MB, partial_lines=0, gaps=True)
    one, two = (traffic([launch(*streams)], H200)[0].gap_lines for streams in ([gaps], [gaps, gaps]))
    assert one == two > 0


def test_whole_lines_cost_nothing_more():
    moved = traffic([store("a", 30 * MB), store("b", 40 * MB)], H200)
    assert [each.gap_lines for each in moved] == [0, 0]


def test_the_rest_of_a_line_is_fetched_from_dram():
    whole, gaps = (traffic([store("a", 10 * MB, gaps=g), store("b", 40 * MB)], H200)[1] for g in (False, True))
    assert gaps.dram_bytes - whole.dram_bytes == pytest.approx(64 * 10 * MB / LINE_BYTES)


def test_each_takes_dram_its_own_time():
    moved = Traffic(0.0, 0.0, 0.0, gap_lines=520.0)
    assert bounds(store("a", 0), H200, moved).term_cycles["dram"] == pytest.approx(100)


@pytest.mark.parametrize("mib", [16, 24, 32])
def test_pushing_them_out_takes_what_was_measured(mib):
    """Records of 56 bytes with and without their last 8, then 60 MB of other stores (40 after 32 MiB).

    Of less, ours is too low: it hides behind the stores, where on the GPU it adds to them.
    """
    records = "records of 56 bytes"
    less, whole = (measured("left", case, "us_after")[mib] for case in (f"{records} less 8", records))
    after = store("b", 40 * MB if mib == 32 else 60 * MB)
    ours, theirs = (price([store("a", mib << 20, gaps=gaps), after], H200)[1] for gaps in (True, False))
    assert 1e3 * (ours.milliseconds - theirs.milliseconds) == pytest.approx(less - whole, rel=0.3)


def test_a_word_of_each_record_brings_in_pairs_of_sectors():
    """All of the records come from DRAM, as measured: 35.8 MB, where 20.5 MB of sectors are loaded."""
    records, size = 640_000, 56 * 640_000
    (cold,) = measured("counters", "a word of each record of 56 bytes, cold", "dram_read_mb_read").values()
    moved = traffic([launch(Stream("a", "load", 32 * records, 32 * records, pair_bytes=size))], H200)[0]
    assert moved.dram_bytes == pytest.approx(cold * MB, rel=0.01)


def test_where_dram_sends_single_sectors_no_pair_is_brought_in():
    moved = traffic([launch(Stream("a", "load", 3200, 3200, pair_bytes=5600))], load_machine("gtx480"))[0]
    assert moved.dram_bytes == 3200
