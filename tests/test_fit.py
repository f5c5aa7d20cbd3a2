"""How fitted a cell is: a made-up experiment with fitted numbers of known effect."""

import re

import pytest

from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import STEP, Fitted, moved, moving, names_cell, on_frame
from tilestamp.models.machine import FOLDER, altered, load_machine
from tilestamp.models.price import price
from tilestamp.models.remembered import priced_property, remembered
from tilestamp.models.used import CHOSEN, FITTED, collect
from tilestamp.simulator import mix
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.scenes.views import KILLEROO_DISTANCE, VIEWS
from tilestamp.simulator.simulation import simulate

HERE, THERE = "cow 64x48", "cow 512x512"
ALU = Fitted("mix: alu", 3.0, (f"{HERE} | made-up | raster | time",))
LOAD = Fitted("gpu: load", 5.0, (HERE,))
DISTANCE = Fitted("cow: distance", 2.0, (f"{HERE} | made-up | cow | patches",), chosen=True)


def cell(row, column, unit, ours, frame=HERE, **more):
    return Cell(row, column, unit, published=10.0, ours=ours, frame=frame, **more)


def experiment(_progress):
    """Times by hand: seven, one or none of ten parts of a time are each number's."""
    alu, load, distance = ALU.value / 3.0, LOAD.value / 5.0, DISTANCE.on(HERE) / 2.0
    cells = [
        cell("raster", "time", "ms", 10 * alu),
        cell("mostly alu", "time", "ms", 7 * alu + load + 2),
        cell("hardly", "time", "ms", 0.5 * alu + 0.4 * load + 9),
        cell("all", "time", "ms", 8 * alu + 1.5 * load + 0.5),
        cell("a little", "time", "ms", 1.5 * alu + 8.5),
        cell("again", "time", "ms", 10 * alu, of=(("raster", "time"),)),
        cell("double", "time", "ms", 20 * alu, of=(("raster", "time"),)),
        cell("elsewhere", "time", "ms", 7 * alu + load + 2, THERE),
        cell("no frame", "time", "ms", 7 * alu, ""),
        cell("cow", "patches", "", 100 * distance),
        cell("cow", "rasters", "", 80 * distance**2 + 20),
        cell("cow", "time", "ms", 9 * distance + 1),
        cell("reported", "time", "ms", 7 * alu + 3, status="reported"),
        cell("reproduced", "count", "", 7 * distance, status="reproduced"),
        cell("faster", "word", "", "alu", of=(("mostly alu", "time"), ("hardly", "time"))),
        cell("slower", "word", "", "alu", of=(("hardly", "time"),)),
    ]
    return result(*cells)


def result(*cells):
    return Result(name="made-up", title="", source="", cells=list(cells))


def judged(run):
    return run_judged(run, lambda _: None)[0].cells


@pytest.fixture(scope="module")
def cells():
    return {(c.row, c.column): c for c in judged(experiment)}


@pytest.mark.parametrize(
    ("row", "status", "share"),
    [
        ("raster", "fitted", 1.0),
        ("mostly alu", "partly fitted", 0.8),
        ("hardly", "predicted", 0.09 / 0.99),
        ("all", "fitted", 0.95),
        ("a little", "partly fitted", 0.15),
        ("elsewhere", "predicted", 0.0),
        ("no frame", "predicted", 0.0),
    ],
)
def test_a_share_is_what_follows_of_the_numbers_of_the_same_frame(cells, row, status, share):
    assert cells[row, "time"].status == status
    assert cells[row, "time"].share == pytest.approx(share, abs=1e-6)


def test_the_numbers_are_named_with_the_part_of_each(cells):
    assert cells["mostly alu", "time"].fitted_by == (
        ("mix: alu", pytest.approx(0.7)),
        ("gpu: load", pytest.approx(0.1)),
    )


def test_a_cell_that_a_number_was_chosen_on_is_fitted_though_it_follows_little():
    target = Fitted("n", 1.0, (f"{HERE} | made-up | raster | time",))

    def little(_progress):
        assert target.value > 0
        return result(cell("raster", "time", "ms", 10.0))

    (found,) = judged(little)
    assert (found.status, found.share) == ("fitted", 1.0)


def test_a_chosen_input_settles_counts_and_half_of_a_time(cells):
    assert cells["cow", "patches"].status == "fitted"
    assert cells["cow", "rasters"].status == "fitted"  # 1.6 times the change: no more than all of it
    assert cells["cow", "rasters"].share == 1.0
    assert cells["cow", "time"].status == "partly fitted"
    assert cells["cow", "time"].share == pytest.approx(0.45)


@pytest.mark.parametrize("status", ["reported", "reproduced"])
def test_what_an_experiment_says_itself_stays(cells, status):
    assert cells[status, "time" if status == "reported" else "count"].status == status


def test_a_word_is_as_fitted_as_the_most_fitted_of_its_cells(cells):
    assert cells["faster", "word"].status == "partly fitted"
    assert cells["slower", "word"].status == "predicted"


def test_a_number_that_is_that_of_a_fitted_cell_is_fitted(cells):
    gap = Fitted("gap", 1.0, (f"{HERE} | made-up | a | time",))

    def run(_progress):
        return result(
            cell("a", "time", "ms", 9 + gap.value),
            cell("b", "time", "ms", 9 + gap.value, of=(("a", "time"),)),
            cell("c", "time", "ms", 8 + gap.value, of=(("a", "time"),)),
        )

    assert [c.status for c in judged(run)] == ["fitted", "fitted", "partly fitted"]
    assert cells["again", "time"].status == "fitted"


@pytest.mark.parametrize("other", [{"frame": THERE}, {"status": "reported"}])
def test_nothing_is_run_again_for_cells_of_other_frames_or_only_reported(other):
    runs = []

    def run(_progress):
        runs.append(moved())
        return result(cell("a", "b", "ms", ALU.value, **other))

    judged(run)
    assert runs == [""]


def test_a_number_is_itself_where_another_is_moved():
    with moving("gpu: load"):
        assert ALU.value == 3.0
        assert LOAD.value == pytest.approx(5.0 * (1 + STEP))
    assert LOAD.value == 5.0


def test_a_number_notes_what_it_was_fitted_to():
    with collect() as used:
        assert ALU.value + DISTANCE.on(THERE) == 5.0
    assert used == {FITTED: {"mix: alu": set(ALU.fitted_to)}}
    with collect() as used:
        assert DISTANCE.on(HERE) == 2.0
    assert used == {CHOSEN: {"cow: distance": set(DISTANCE.fitted_to)}}


@pytest.mark.parametrize(
    ("target", "frame", "on"),
    [
        ("cow 64x48 | a | b | c", "cow 64x48", True),
        ("cow *", "cow 64x48", True),
        ("cow * or spot *", "spot 64x48", True),
        ("cow * or spot *", "spotless 64x48", False),
        ("*", "", False),
    ],
)
def test_targets_name_frames(target, frame, on):
    assert on_frame(target, frame) == on


def test_targets_name_cells():
    assert names_cell("cow * | r | * | time or count", ("cow 1", "r", "any", "count"))
    assert not names_cell("cow * | r | * | time or count", ("cow 1", "r", "any", "counts"))
    assert not names_cell("cow *", ("cow 1", "r", "any", "count"))


class Priced:
    """A price and who made it."""

    def __init__(self):
        self.calls = []

    @priced_property
    def time(self):
        """Two of a number."""
        self.calls.append(moved())
        return 2 * ALU.value


def test_a_price_is_kept_made_again_under_a_move_and_kept_again():
    run = Priced()
    times = []
    for name in ("", "mix: alu", "gpu: load", "mix: alu", ""):
        with moving(name), collect() as used:
            times.append(run.time)
        assert "mix: alu" in used[FITTED]
    assert times == [6.0, pytest.approx(6.06), 6.0, pytest.approx(6.06), 6.0]
    assert run.calls == ["", "mix: alu"]


def test_what_is_remembered_is_made_again_where_its_input_is_moved():
    calls = []

    @remembered
    def draw(size):
        calls.append(moved())
        return size * DISTANCE.value * ALU.value

    with moving("mix: alu"):
        assert draw(1.0) == 6.0  # prices are not its business
    with moving("cow: distance"):
        assert [draw(1.0), draw(1.0)] == [pytest.approx(6.06)] * 2
    assert draw(1.0) == 6.0
    assert calls == ["", "cow: distance"]


@pytest.fixture(scope="module")
def frame():
    return simulate("teapot", "micropolygon", "gtx280", width=80, height=60)


def test_a_number_of_a_machine_moves_the_time_of_a_run(frame):
    with moving("gtx280: launch.blocks_per_us"):
        moved_ms = frame.milliseconds
        faster = price(frame.launches, load_machine("gtx280"))
    assert moved_ms < frame.milliseconds
    assert sum(timing.milliseconds for timing in faster) == pytest.approx(moved_ms)
    by_hand = altered(load_machine("gtx280"), {"launch.blocks_per_us": 3.66 * (1 + STEP)}, "assumed", "test")
    assert frame.on(by_hand).milliseconds == pytest.approx(moved_ms)


def test_an_altered_number_is_no_longer_the_fitted_one(frame):
    other = frame.on(altered(load_machine("gtx280"), {"launch.blocks_per_us": 5.0}, "assumed", "test"))
    before = other.milliseconds
    with moving("gtx280: launch.blocks_per_us"):
        assert other.milliseconds == before
        assert other.machine.as_moved.launch.blocks_per_us == 5.0


def test_a_number_of_a_mix_moves_the_instructions_of_a_run(frame):
    before = frame.stages.loc["tile_raster", "instructions"]
    with moving("micropolygon/cc1: tile_raster.Z_LANES.int32"):
        after = frame.stages.loc["tile_raster", "instructions"]
    lanes = frame.counts["tile_raster.Z_LANES"]
    assert lanes > 0
    assert after - before == pytest.approx(61 * STEP * lanes, abs=1)


def test_only_the_fitted_part_of_a_price_is_moved():
    kernel = load_mix("cudaraster", "9.0").kernels["triangleSetup"]
    before = kernel.prices["FAST_WARPS"]["int32"]
    with moving("cudaraster/cc9: triangleSetup.FAST_WARPS.int32"):
        assert kernel.as_moved.prices["FAST_WARPS"]["int32"] == pytest.approx(before + 2.09 * STEP)
        assert kernel.as_moved.prices["SITE_WARPS"] == kernel.prices["SITE_WARPS"]


def test_a_view_moves_on_the_frame_that_its_distance_was_fitted_to_and_on_no_other():
    view = VIEWS["killeroo"]["default"]
    here, there = view.matrix(1600, 1200), view.matrix(512, 512)
    with moving("killeroo: distance of the view"):
        assert (view.matrix(512, 512) == there).all()
        farther = view.matrix(1600, 1200)
    assert farther[3, 3] - here[3, 3] == pytest.approx(KILLEROO_DISTANCE * STEP)  # w of the point that it looks at
    assert (view.matrix(1600, 1200) == here).all()


@pytest.mark.parametrize(("pattern", "instead"), [(r", fitted_to = \[.*?\]", ""), ('"assumed"', '"fitted"')])
def test_a_fitted_number_of_a_machine_must_say_to_what(tmp_path, pattern, instead):
    text = (FOLDER / "gtx280.toml").read_text()
    (tmp_path / "mine.toml").write_text(re.sub(pattern, instead, text))
    with pytest.raises(TilestampError, match="fitted_to"):
        load_machine(tmp_path / "mine.toml")


@pytest.mark.parametrize("line", ['fitted_to = "nowhere"', ""])
def test_a_fitted_event_of_a_mix_must_say_to_what(tmp_path, monkeypatch, line):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "cc1.toml").write_text(
        f'[k]\nprovenance = "derived"\nsource = "x"\n[k.E]\nfp32 = 1\nprovenance = "fitted"\nsource = "y"\n{line}\n'
    )
    monkeypatch.setattr(mix, "MIXES", tmp_path)
    with pytest.raises(TilestampError, match="fitted_to"):
        load_mix("mine", "1.3")


def test_a_word_is_as_fitted_as_the_times_that_it_is_made_of_though_they_are_only_reported():
    def run(_progress):
        made_of = cell("a", "time", "ms", 5 * ALU.value / 3 + 5, status="reported")
        word = cell("a", "word", "", "fast", of=(("a", "time"),))
        return result(made_of, word)

    assert [c.status for c in judged(run)] == ["reported", "partly fitted"]
