"""Roads not taken in time, lens and projection: each experiment runs in small, draws, and says what its numbers say."""

import pytest

from tests.roads import check_in_small
from tilestamp.experiments.exploration import nonlinear, stochastic

SMALL = {
    stochastic: {
        "EDGES": (8.0,), "WAYS": (0.0, 64.0), "CIRCLES": (4.0,), "SEEDS": range(100, 101), "WIDTH": 48, "HEIGHT": 36,
    },
    nonlinear: {"SIDES": (1, 4), "TOLERANCES": (16.0, 0.25), "WIDTH": 48, "HEIGHT": 36},
}  # fmt: skip


@pytest.mark.parametrize("road", SMALL, ids=lambda module: module.__name__.rpartition(".")[2])
def test_a_road_has_cells_sentences_and_pictures(road, monkeypatch, tmp_path):
    check_in_small(road, SMALL[road], monkeypatch, tmp_path)


def test_tiles_pay_for_large_polygons_and_not_for_small_ones():
    """What the page says: a seventh of the interleaved method's time at 32 pixels, 35 times as long at 2."""
    small, large = (
        stochastic.draw("tiles of 8, intervals", edge, motion=0.0, lens=0.0).milliseconds
        / stochastic.draw("interleaved", edge, motion=0.0, lens=0.0).milliseconds
        for edge in (2.0, 32.0)
    )
    assert small > 10
    assert large < 0.3
