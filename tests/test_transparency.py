"""Experiments on transparency: where bounded methods break, and scenes that are what they say."""

import numpy as np
import pytest

from tilestamp.experiments.exploration.order_independent import METHODS, drawn, layered, measured
from tilestamp.experiments.exploration.programmable_rop import drawn as drawn_by
from tilestamp.experiments.exploration.transparent_scenes import piles
from tilestamp.experiments.stability import bounded_layers


@pytest.mark.parametrize("front_first", [True, False])
@pytest.mark.parametrize(("method", "room"), [("fixed lists of 4", 4), ("fixed lists of 8", 8)])
def test_fixed_lists_break_with_the_first_layer_too_many(method, room, front_first):
    assert bounded_layers.off(room, method, front_first=front_first) <= 1
    assert bounded_layers.off(room + 1, method, front_first=front_first) > bounded_layers.ROUNDING


def test_a_k_buffer_stands_for_any_layers_that_come_farthest_first():
    assert max(bounded_layers.off(layers, "k-buffer of 4", front_first=False) for layers in (5, 9, 16)) <= 1


def test_a_k_buffer_has_its_k_layers_and_one_in_any_order():
    assert bounded_layers.off(5, "k-buffer of 4", front_first=True) <= 1
    assert bounded_layers.off(7, "k-buffer of 4", front_first=True) > bounded_layers.ROUNDING


def test_more_layers_of_a_k_buffer_are_less_off():
    scene = layered(4)
    truth = drawn(scene, "linked", "h200")
    errors = [measured(drawn(scene, f"k-buffer {k}", "h200"), truth, f"k-buffer {k}")["rms"] for k in (2, 4, 8)]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 1 > errors[2]


def test_all_exact_methods_draw_one_picture():
    pictures = [drawn(layered(2), name, "h200").image for name in METHODS if name in ("linked", "round", "chunked")]
    assert len(pictures) == 3
    assert all(np.array_equal(picture, pictures[0]) for picture in pictures)


def test_piles_together_make_lanes_take_turns_and_piles_apart_do_not():
    rounds = {}
    for together in (True, False):
        counts = drawn_by(piles(64, 2, 8, together=together), "over", side=64).counts
        rounds[together] = counts["fine_raster.ROP_STEPS"] / counts["fine_raster.SHADE_ROUNDS"]
    assert rounds[True] > 7
    assert rounds[False] < 2.5
