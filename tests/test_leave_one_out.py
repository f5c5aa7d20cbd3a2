"""Leaving a scene out: what predicts it was fitted to the others alone."""

import numpy as np
import pytest

from tilestamp.experiments.silicon.leave_one_out_tiled import PAIRS, Timed, left_out


def timed(scene, best):
    """A scene that one pair of chains predicts exactly, and each other one worse, the farther it is."""
    return Timed(scene, "tiled", 100.0, 100.0 + 5.0 * np.abs(np.arange(len(PAIRS)) - best))


def test_the_scene_itself_has_no_say_in_what_predicts_it():
    cells = left_out([timed("a", 10), timed("b", 20), timed("c", 20)])
    assert [cell.ours for cell in cells] == pytest.approx([150.0, 125.0, 125.0])
