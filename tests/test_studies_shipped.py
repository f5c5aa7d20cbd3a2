"""Shipped studies: each runs in small, draws, and says what its numbers say."""

import numpy as np
import pandas as pd
import pytest

from tilestamp import simulate
from tilestamp.experiments.harness.registry import load_experiment, select
from tilestamp.experiments.harness.write import draw_figure
from tilestamp.experiments.questions.best import Boundary
from tilestamp.experiments.studies.area import L2_MB, area
from tilestamp.experiments.studies_shipped import (
    atomics_or_sort,
    better_than_h200,
    gtx280_lacks,
    software_or_hardware,
    tile_size,
    what_if,
)
from tilestamp.models.machine import altered, load_machine


def _tiny_frame(tile):
    return simulate("teapot", machine="gtx280", width=64, height=48, tile=tile)


SMALL = {
    tile_size: {
        "TILES": [4, 8],
        "ZOOM": [1.0, 4.0],
        "FIXED": {"scene": "teapot", "size": "64x48"},
        "list_machines": lambda: {"gtx280": "", "h200": ""},
    },
    gtx280_lacks: {"TILES": (4, 8), "FACTORS": (0.5, 2.0), "frame": _tiny_frame},
    software_or_hardware: {"MACHINES": ("gtx480", "h200"), "AREAS": (16.0, 64.0), "WIDTH": 64, "HEIGHT": 48},
    atomics_or_sort: {"MACHINES": ("gtx480", "h200"), "TRIANGLES": 64, "SIZE": 64, "SIDES": (64, 16)},
    better_than_h200: {
        "SIZE": (64, 48),
        "STEPS": 1,
        "AREAS": {"middle": 32.0},
        "MOVES": {"sm.count": (0.5,), "pipe.fp32": (2.0,)},
    },
    what_if: {"SIZE": (64, 48), "FACTORS": (1.0, 2.0)},
}


@pytest.fixture(params=SMALL, ids=lambda module: module.__name__.rpartition(".")[2])
def small(request, monkeypatch):
    """A study in small."""
    for name, value in SMALL[request.param].items():
        monkeypatch.setattr(request.param, name, value)
    return request.param


def test_a_shipped_study_has_cells_sentences_and_pictures(small, tmp_path):
    result = small.run(lambda _: None)
    assert result.cells
    assert {cell.status for cell in result.cells} == {"reported"}
    assert all(note.endswith(".") for note in result.notes)
    assert result.figures
    for figure in result.figures:
        draw_figure(figure, result, tmp_path / f"{figure.name}.png")
        assert (tmp_path / f"{figure.name}.png").stat().st_size > 5000


def test_a_chart_of_a_study_has_its_columns(small):
    result = small.run(lambda _: None)
    for chart in result.charts:
        table = result.tables[chart.table]
        columns = {chart.of[role] for role in ("x", "y", "color", "bar", "value") if role in chart.of}
        assert columns | {*chart.of.get("pick", ()), *chart.of.get("sliders", ())} <= set(table.columns)


def test_the_what_if_prices_the_frame_that_it_drew(monkeypatch):
    monkeypatch.setattr(what_if, "FACTORS", (1.0, 2.0))
    made = simulate("teapot", "micropolygon", "gtx280", width=64, height=48)
    times = what_if.priced(made).groupby(list(what_if.NUMBERS))["milliseconds"].sum()
    assert times[1.0, 1.0, 1.0] == pytest.approx(made.milliseconds, abs=1e-3)
    faster = made.on(altered(made.machine, {"sm.clock_mhz": 2 * made.machine.sm.clock_mhz}))
    assert what_if.twice(times)["clock"] == pytest.approx(faster.milliseconds, abs=1e-3)


def test_the_what_if_counts_tiles_from_the_top():
    made = simulate("teapot", "micropolygon", "gtx280", width=64, height=48)
    table = what_if.tiles(made)
    drawn = np.unique(np.nonzero((made.image != made.image[0, 0]).any(axis=-1))[0] // 8)
    assert table["tests"].sum() == made.frame.maps["tests"].sum()
    assert (table["y"].min(), table["y"].max()) == (drawn.min(), drawn.max())
    assert drawn.min() != 48 // 8 - 1 - drawn.max()  # counted from below, it would be another row


def test_all_of_them_are_named_at_once():
    assert len(select(("studies",))) == len(SMALL)
    assert all(callable(load_experiment(name)) for name in select(("studies",)))


def test_of_the_tiles_each_is_said_with_what_it_costs_everywhere():
    places = {"bound": [2.0, 2.0], "zoom": [1.0, 4.0], "machine": ["a", "a"]}
    table = pd.concat(
        pd.DataFrame({**places, "tile": tile, "milliseconds": times}) for tile, times in {4: [1, 3], 8: [2, 1]}.items()
    )
    best = pd.DataFrame({**places, "best": [4, 8], "milliseconds": [1, 1], "second": [8, 4], "margin": [1.0, 2.0]})
    assert tile_size._cost(best, table, 4) == "4x4 everywhere: 2.00 times the best in the median, 3.00 at worst."
    assert "8x8 is the fastest at bound 2, zoom 4 to 4, on a (1)" in tile_size._where(best, 8)
    assert "4x4 takes 200% longer" in tile_size._where(best, 8)


def test_a_scan_multiplies_one_number_and_leaves_out_what_no_machine_has():
    found = gtx280_lacks.machines()
    base = load_machine("gtx280")
    assert found["sm.clock_mhz", 1.0] == base
    assert found["sm.clock_mhz", 0.25].sm.clock_mhz == base.sm.clock_mhz / 4
    assert found["sm.count", 1 / 16].sm.count == 2  # 30 / 16
    assert ("sm.count", 1 / 64) not in found
    assert not [key for key, _ in found if key == "memory.l2_bytes"]  # it is 0


def test_what_a_machine_lacked_is_the_change_nearest_to_it():
    def change(number, before, after, at):
        return Boundary({"number": number}, before, after, at)

    changes = [
        change("clock", 8, 4, 8.0),
        change("clock", 4, 8, 0.5),  # below half the clock 4x4 is the best: nearer than eight times
        change("sms", 8, 16, 3.0),
        change("sms", 16, 4, 10.0),
        change("units", 8, 4, 1.5),
    ]
    found = gtx280_lacks.nearest(changes, 8)
    assert found == {("units", 4): 1.5, ("clock", 4): 0.5, ("sms", 16): 3.0, ("sms", 4): 10.0}
    assert next(iter(found)) == ("units", 4)
    assert "units at 1.50 times, clock at 0.50 times" in gtx280_lacks._sentence(found, 8, 4)
    assert "No single number" in gtx280_lacks._sentence(found, 8, 32)


def test_software_over_hardware_and_where_they_cross():
    table = pd.DataFrame(
        {
            "machine": "a",
            "area": [1.0, 1.0, 100.0, 100.0],
            "pipeline": ["cudaraster", "hardware"] * 2,
            "milliseconds": [1.0, 2.0, 8.0, 4.0],
        }
    )
    ratios = software_or_hardware.ratio_table(table)
    assert ratios["ratio"].tolist() == [0.5, 2.0]
    crossing = [Boundary({"machine": "a"}, "cudaraster", "hardware", 10.0)]
    first = software_or_hardware.notes(ratios, crossing)[0]
    assert first.startswith(
        "a: cudaraster is faster up to 10 pixels a triangle, then hardware (software takes 0.5 times"
    )
    assert "hardware is faster at every size" in software_or_hardware.notes(ratios.assign(ratio=3.0), [])[0]
    assert "cudaraster is faster at every size" in software_or_hardware.notes(ratios.assign(ratio=0.3), [])[0]


def test_a_pile_lies_in_its_square_with_its_layers():
    mesh = atomics_or_sort.piled(128).mesh
    pixels = (mesh.positions[:, :2] + 1) * atomics_or_sort.SIZE / 2
    low, high = (atomics_or_sort.SIZE - 128) / 2, (atomics_or_sort.SIZE + 128) / 2
    assert low - 0.01 <= pixels.min() < low + 1
    assert high - 1 < pixels.max() <= high + 0.01
    assert atomics_or_sort.layers(128) == pytest.approx(len(mesh.triangles) * 32 / 128**2)


def test_all_neighbours_have_the_area_of_an_h200():
    base = load_machine("h200")
    here = {name: base.number(name) for name in (*better_than_h200.MOVES, "memory.l2_bytes")}
    found = better_than_h200.neighbours(here)
    areas = [area(altered(base, design)) for design in found.values()]
    assert areas == pytest.approx([area(base)] * len(areas), abs=L2_MB / 1000)
    assert found["pipe.fp32 x 2, SMs"]["sm.count"] > 132 == found["pipe.fp32 x 2, L2"]["sm.count"]
    assert found["pipe.fp32 x 2, L2"]["memory.l2_bytes"] > here["memory.l2_bytes"]
    assert found["pipe.fp32 x 2, SMs"]["memory.l2_bytes"] >= here["memory.l2_bytes"]  # what no SM fits in is L2
    assert "sm.count x 1.1, L2" not in found  # no L2 would be left


def test_steps_are_taken_while_they_gain(monkeypatch):
    def times(_study, points, _names):
        return np.array([[1.0 / point["sm.count"]] for point in points]), [""] * len(points)

    monkeypatch.setattr(better_than_h200, "values_at", times)
    rows = pd.DataFrame(better_than_h200.descend(None, lambda _: None))
    taken = rows[rows.taken]
    assert taken["milliseconds"].is_monotonic_decreasing
    assert taken["sm.count"].iloc[-1] > 150
    for step, tried in rows[rows.step > 0].groupby("step"):
        gained = tried[tried.taken]
        assert len(gained) <= 1
        assert (gained["milliseconds"] == tried["milliseconds"].min()).all(), step
