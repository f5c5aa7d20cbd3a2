"""nvdiffrast's DepthPeeler: layers from front to back, and when it may be called."""

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.nvdiffrast import DepthPeeler, rasterize

WALLS = 5
Z = np.linspace(-0.8, 0.8, WALLS, dtype=np.float32)[[3, 0, 4, 1, 2]]  # in another order than their depth


def walls():
    """Triangles that cover the screen at several depths, and two at one depth."""
    corners = np.array([[-1, -1], [3, -1], [-1, 3]], np.float32)
    pos = np.concatenate([np.column_stack([corners, np.full(3, z), np.ones(3)]) for z in (*Z, Z[0])])
    return pos[None].astype(np.float32), np.arange(3 * (WALLS + 1), dtype=np.int32).reshape(-1, 3)


def layers(count, *scene, **options):
    with DepthPeeler(*scene, **options) as peeler:
        return [peeler.rasterize_next_layer() for _ in range(count)]


def test_layers_come_from_front_to_back():
    shown = [rast[0, 3, 3, 3] for rast, _ in layers(WALLS, *walls(), (8, 8))]
    assert shown == [*(1 + np.argsort(Z))[:3], 6, *(1 + np.argsort(Z))[4:]]  # of equal depths the last


def test_after_the_last_layer_nothing_is_drawn():
    rast, rast_db = layers(WALLS + 1, *walls(), (8, 8))[-1]
    assert not rast.any()
    assert not rast_db.any()


def test_the_first_layer_is_what_rasterize_draws():
    first = layers(1, *walls(), (24, 2100))[0]
    assert all(np.array_equal(a, b) for a, b in zip(first, rasterize(*walls(), (24, 2100)), strict=True))


def test_layers_of_random_triangles_hold_every_fragment_once():
    rng = np.random.default_rng(5)
    pos = np.concatenate([rng.uniform(-1.2, 1.2, (1, 60, 3)), np.ones((1, 60, 1))], -1).astype(np.float32)
    tri = np.arange(60, dtype=np.int32).reshape(-1, 3)
    ids = np.stack([rast[0, ..., 3] for rast, _ in layers(21, pos, tri, (32, 32))])
    alone = np.stack([rasterize(pos, tri[t : t + 1], (32, 32))[0][0, ..., 3] > 0 for t in range(20)])
    found = np.stack([(ids == t + 1).sum(axis=0) for t in range(20)])
    assert np.array_equal(found, alone)


def test_a_peeler_that_has_ended_is_not_entered_again():
    peeler = DepthPeeler(*walls(), (8, 8))
    with peeler:
        pass
    with pytest.raises(TilestampError, match="has ended"), peeler:
        pass


def test_a_layer_is_drawn_inside_the_block_only():
    with pytest.raises(TilestampError, match="with block"):
        DepthPeeler(*walls(), (8, 8)).rasterize_next_layer()


def test_rasterize_draws_while_a_peeler_is_at_work():
    with DepthPeeler(*walls(), (8, 8)):
        assert rasterize(*walls(), (8, 8))[0].any()


def test_with_the_faults_of_the_original_rasterize_returns_an_exception_meanwhile():
    with DepthPeeler(*walls(), (8, 8), faults="kept"):
        assert isinstance(rasterize(*walls(), (8, 8)), RuntimeError)
    assert rasterize(*walls(), (8, 8))[0].any()


def test_with_the_faults_of_the_original_a_second_peeler_is_refused():
    with DepthPeeler(*walls(), (8, 8), faults="kept"), pytest.raises(TilestampError, match="one depth peeler"):
        DepthPeeler(*walls(), (8, 8), faults="kept").__enter__()
