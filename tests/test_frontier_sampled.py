"""What a part of a frame could save: the passes over boxes, the tiles that are drawn, and one small scene."""

import numpy as np
import pytest

from tilestamp import simulate
from tilestamp.experiments.frontier import sampled
from tilestamp.experiments.frontier.sampled_boxes import boxes
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.scenes.scene import Mesh

WIDTH, HEIGHT = 100, 60


@pytest.fixture(scope="module")
def full():
    """Give a small frame in full."""
    return simulate("teapot", "micropolygon", "gtx280", width=160, height=120, picture=False)


def soup(count=80):
    """Triangles at the eye's depth, in clip space."""
    random = np.random.default_rng(3)
    corners = np.zeros((count, 3, 4), np.float32)
    corners[:, :, :2] = random.uniform(-1, 1, (count, 1, 2)) + random.uniform(-0.2, 0.2, (count, 3, 2))
    corners[:, :, 3] = 1
    return Mesh(corners.reshape(-1, 4), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), clip_space=True)


def listed(mesh):
    """Tiles of each triangle's box, as sets of (column, row), by definition."""
    found = []
    for triangle in mesh.positions[mesh.triangles][:, :, :2].astype(np.float64):
        x, y = (np.trunc(triangle * (8 * WIDTH, 8 * HEIGHT)) / 16 + (WIDTH / 2, HEIGHT / 2)).T
        if (x[1] - x[0]) * (y[2] - y[0]) <= (y[1] - y[0]) * (x[2] - x[0]):
            continue
        columns, rows = (
            {p // 8 for p in range(size) if a.min() <= p + 0.5 <= a.max()}
            for a, size in zip((x, y), (WIDTH, HEIGHT), strict=True)
        )
        found.append({(column, row) for column in columns for row in rows})
    return found


def test_boxes_of_front_faces_are_listed_in_their_tiles():
    mesh = soup()
    tiles = listed(mesh)
    assert boxes(mesh, np.eye(4), WIDTH, HEIGHT, 1.0) == (sum(map(len, tiles)), sum(map(bool, tiles)))


def test_no_triangle_meets_a_share_of_no_tiles():
    assert boxes(soup(), np.eye(4), WIDTH, HEIGHT, 0.0)[1] == 0


def test_all_tiles_tell_the_frame_as_it_is(full):
    assert sampled.error_of(full, 1.0, 0) == 0.0


def test_tiles_that_did_not_run_do_what_one_with_as_long_a_list_did(full):
    work = full.frame.works[-1]
    part = sampled._drawn(work, 0.05, 1)
    rows = {tuple(row) for row in part.table.tolist()}
    assert len(rows) <= 0.05 * len(work.table) + 1
    assert rows <= {tuple(row) for row in work.table.tolist()}
    before, after = (one.table[:, one.events["GRIDS"]] for one in (work, part))
    assert np.corrcoef(before, after)[0, 1] > 0.9


def test_a_larger_part_is_nearer_to_the_frame(full):
    errors = [np.mean([sampled.error_of(full, rate, seed) for seed in range(20)]) for rate in (0.02, 0.5)]
    assert errors[1] < errors[0]


def test_every_sampler_costs_at_least_what_it_cannot_leave_out():
    case = sampled.Case("small", lambda: load_scene("spot"), "cudaraster", "gtx480", size=(160, 120))
    rows = sampled.rows_of(case, case.scene())
    assert {row["method"] for row in rows} == {sampled.TILES, sampled.NUMBERS}
    for row in rows:
        least = (
            row["boxes_seconds"]
            if row["method"] == sampled.NUMBERS
            else row["full_cpu_seconds"] - row["last_stage_seconds"]
        )
        assert least < row["cpu_seconds"] < row["full_cpu_seconds"]
