"""FreePipe: picture, warps and the GPU's own figures."""

import csv

import numpy as np
import pytest

from tests.naive_bins import covers
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.freepipe import FreepipeOptions
from tilestamp.simulator.pipelines.freepipe import freepipe as pipeline
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.liu2010.freepipe import freepipe
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_triangle import make_pieces

E = FreePipeEvent
SCENES = [("bunny", 512), ("bunny", 1024), ("dragon100k", 512), ("teapot16k", 1024), ("nearclip5k", 1024),
          ("edges_512", 512)]  # fmt: skip


def soup(triangles=150, seed=0, size=0.4):
    """Random triangles in clip space, some across the frustum's planes."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-1.1, 1.1, (triangles, 1, 3))
    xyz = middle + rng.uniform(-size, size, (triangles, 3, 3))
    w = rng.uniform(0.5, 2, (triangles, 3, 1))
    positions = np.concatenate([xyz * w, w], axis=2).reshape(-1, 4).astype(np.float32)
    return positions, np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3)


def flat(corners, z=0.0):
    """Triangles with corners in pixels of a 64x64 frame, all at depth z."""
    xy = np.array(corners, np.float32).reshape(-1, 2) / 32 - 1
    positions = np.column_stack([xy, np.full(len(xy), z), np.ones(len(xy))]).astype(np.float32)
    return positions, np.arange(len(xy), dtype=np.int32).reshape(-1, 3)


TINY = [(1.25, 1.25), (2, 1.25), (1.25, 2)]  # covers the centre of pixel (1, 1), and no other is in its box
LARGE = [(0, 0), (60, 0), (0, 60)]


def test_each_pixel_shows_the_nearest_triangle_that_covers_it():
    positions, triangles = soup()
    frame, _, _ = freepipe(positions, triangles, 64, 48, Simt())
    pieces = make_pieces(positions, triangles, 64, 48)
    owner = np.repeat(np.arange(len(triangles)), np.diff(pieces.first))
    covered = np.zeros((48, 64), bool)
    for p in range(len(pieces.corner)):
        corners = pieces.corner[p].astype(int).reshape(3, 2).tolist()
        for y, x in np.ndindex(48, 64):
            if pieces.facing[p] and covers(corners, x, y, 4):
                covered[y, x] = True
                right, up = 16 * (x - pieces.box[p, 0]), 16 * (y - pieces.box[p, 2])
                z = pieces.depth[p] @ [1, right, up]
                fixed = np.clip(z / 2 + 0.5, 0, 1) * (2**32 - 256)
                assert frame.depth[y, x] <= fixed + 5000
                if frame.ids[y, x] == owner[p]:
                    assert abs(int(frame.depth[y, x]) - fixed) < 5000
    assert np.array_equal(frame.ids >= 0, covered)


def test_a_warp_runs_as_long_as_its_largest_triangle():
    positions, triangles = flat([*LARGE, *(TINY * 31)])
    simt = Simt(coalescing=Coalescing.WARP_LINES)
    _, (work,), _ = freepipe(positions, triangles, 64, 64, simt)
    alone = freepipe(*flat(LARGE), 64, 64, simt)[1][0]
    assert work.total(E.WARP_STEPS) == alone.total(E.WARP_STEPS) == 60 * 60
    assert work.total(E.SAMPLE_TESTS) == 60 * 60 + 31


def test_an_unrolled_loop_takes_the_pixels_beyond_a_multiple_of_four_by_themselves():
    positions, triangles = flat([*LARGE, *(TINY * 31)])
    _, (work,), _ = freepipe(positions, triangles, 64, 64, Simt(coalescing=Coalescing.WARP_SECTORS))
    assert work.total(E.REST_STEPS) == 1  # the small ones' only pixel; 60 is a multiple of four
    assert work.total(E.WARP_STEPS) == 60 * 60 + 1
    assert work.total(E.SAMPLE_TESTS) == 60 * 60 + 31


def test_long_rows_are_covered_where_all_edge_functions_say_so():
    """On the widest frame, whose edge functions have the largest numbers."""
    positions, triangles = soup(40, seed=4, size=0.9)
    width, height = 16384, 3
    _, (work,), _ = freepipe(positions, triangles, width, height, Simt())
    pieces = make_pieces(positions, triangles, width, height)
    x, y = 16 * np.arange(width) + 8, 16 * np.arange(height)[:, None] + 8
    hits = 0
    for corner in pieces.corner[pieces.facing != 0].astype(np.int64).reshape(-1, 3, 2):
        inside = np.ones((height, width), bool)
        for (ax, ay), (dx, dy) in zip(corner, np.roll(corner, -1, axis=0) - corner, strict=True):
            owns = dy < 0 or (dy == 0 and dx > 0)
            inside &= dx * (y - ay) - dy * (x - ax) >= (0 if owns else 1)
        hits += inside.sum()
    assert work.total(E.SAMPLE_HITS) == hits > 50_000


def test_hits_are_the_pixels_drawn_where_a_corner_is_beyond_all_bounds():
    """The inverse of so small a w is infinite, and so are the corner's coordinates."""
    corners = [
        [-5.590048594e-41, -8.9886160955e-41, 0, 1e-40],
        [0.646866, 0.94461876, 0, 1],
        [-0.7488851, 0.7196617, 0, 1],
    ]
    frame, (work,), _ = freepipe(np.array(corners, np.float32), np.array([[0, 1, 2]], np.int32), 64, 48, Simt())
    assert work.counts()["SAMPLE_HITS"] == (frame.ids >= 0).sum() > 0


def test_lanes_at_the_same_pixel_conflict():
    positions, triangles = flat(TINY * 32)
    _, (work,), _ = freepipe(positions, triangles, 64, 64, Simt())
    assert work.total(E.ATOMIC) == 1
    assert work.total(E.ATOMIC_DEPTH) == 32
    assert work.total(E.ATOMIC_CONFLICTS) == 31
    assert work.total(E.ATOMIC_REQUESTS) == 32
    assert work.atomic_requests[(65 * 8) // 32] == 32


def test_distinct_pixels_of_a_sector_share_a_request_only_where_the_machine_merges():
    corners = [(x + dx, y) for x in range(32) for dx, y in [(0.25, 1.25), (1, 1.25), (0.25, 2)]]
    totals = [
        freepipe(*flat(corners), 64, 64, Simt(atomic_merge=merge))[1][0].total(E.ATOMIC_REQUESTS)
        for merge in (AtomicMerge.NONE, AtomicMerge.SECTOR)
    ]
    assert totals == [32, 8]


def test_requests_by_chunk_sum_to_the_requests():
    _, (work,), _ = freepipe(*soup(), 64, 48, Simt(), packing="32")
    assert work.atomic_requests.sum() == work.total(E.ATOMIC_REQUESTS)
    assert work.total(E.ATOMIC_LANES) == 2 * work.total(E.SAMPLE_HITS)


def test_reading_first_changes_no_pixel_and_saves_atomics():
    blind, (all_of_them,), _ = freepipe(*soup(), 64, 48, Simt())
    early, (fewer,), _ = freepipe(*soup(), 64, 48, Simt(), early=True)
    assert np.array_equal(blind.ids, early.ids)
    assert fewer.total(E.ATOMIC_LANES) < all_of_them.total(E.ATOMIC_LANES) == fewer.total(E.SAMPLE_HITS)
    assert fewer.total(E.READS) == all_of_them.total(E.ATOMIC)


def test_of_equal_depths_the_least_number_stays_and_the_tie_is_reported():
    frame, _, facts = freepipe(*flat(TINY * 3), 64, 64, Simt())
    assert frame.ids[1, 1] == 0
    assert facts["tied_pixels"] == 1


def test_two_halves_can_come_from_two_triangles():
    colors = np.array([0x001FFF, 0x002000], np.uint32)  # least upper half: the first's; least lower half: the second's
    frame, _, facts = freepipe(*flat(TINY * 2), 64, 64, Simt(), packing="32", colors=colors)
    assert frame.colors[1, 1] == 0x001000
    assert facts["mixed_pixels"] == 1


def test_halves_of_one_triangle_are_not_reported():
    colors = np.array([0x001000, 0x002FFF], np.uint32)
    frame, _, facts = freepipe(*flat(TINY * 2), 64, 64, Simt(), packing="32", colors=colors)
    assert frame.colors[1, 1] == 0x001000
    assert facts["mixed_pixels"] == 0


def test_a_w_that_is_no_number_draws_nothing():
    positions, triangles = flat(LARGE)
    positions[0, 3] = np.nan
    assert (freepipe(positions, triangles, 64, 64, Simt())[0].ids == -1).all()


def test_a_coordinate_that_is_no_number_goes_to_the_centre_as_conversions_do():
    positions, triangles = flat([(0, 0), (40, 40), (0, 60)])
    positions[1, 0] = np.nan
    expected = flat([(0, 0), (32, 40), (0, 60)])[0]
    assert np.array_equal(*(freepipe(p, triangles, 64, 64, Simt())[0].ids for p in (positions, expected)))


def test_no_triangles_draw_nothing():
    frame, (work,), facts = freepipe(np.zeros((0, 4), np.float32), np.zeros((0, 3), np.int32), 8, 8, Simt())
    assert (frame.ids == -1).all()
    assert (len(work.table), facts["fragments"]) == (0, 0)


def test_only_one_packing_can_be_read_before_its_atomic():
    with pytest.raises(TilestampError, match="early"):
        FreepipeOptions(packing="32", early=True)


def test_indices_out_of_range_are_refused():
    positions, triangles = flat(TINY)
    with pytest.raises(TilestampError, match=r"outside 0\.\.2"):
        freepipe(positions, triangles + 1, 64, 64, Simt())


def test_the_pipeline_puts_the_top_row_first():
    positions, triangles = flat([(0, 0), (64, 0), (0, 20)])
    scene = Scene("low", mesh=Mesh(positions, triangles, clip_space=True))
    for packing in ("64", "32"):
        frame = pipeline(scene, np.eye(4), 64, 64, Simt(), FreepipeOptions(packing=packing), Executor())
        assert frame.triangle_ids[-1, 0] == 0
        assert frame.triangle_ids[0, 0] == -1
        assert frame.image[-1, 0].min() > 0
        assert frame.image[0].max() == 0


def statistics(shared, name, width):
    with (shared / "silicon/freepipe.csv").open() as rows:
        return {
            row["kernel"] + "/" + row["metric"]: float(row["value"])
            for row in csv.DictReader(rows)
            if (row["scene"], row["W"]) == (name, str(width)) and row["source"] in {"stats", "ncu_cold"}
        }


@pytest.mark.parametrize(("name", "width"), SCENES)
def test_pixels_and_fragments_are_those_of_the_gpu(shared, name, width):
    data = np.load(shared / f"silicon/ids/{name}_input.npz")
    gpu = statistics(shared, name, width)
    frame, (work,), facts = freepipe(data["positions"], data["triangles"], width, width * 3 // 4, Simt())
    assert facts["pixels_tested"] == gpu["stats/bbox_pixels_tested"]
    assert facts["fragments"] == gpu["stats/fragments"]
    loads = gpu["freepipe/l1tex__t_sectors_pipe_lsu_mem_global_op_ld.sum"]
    assert work.total(E.LOAD_TRANSACTIONS) == pytest.approx(loads, rel=1e-3)
    sectors = gpu["freepipe/l1tex__t_sectors_pipe_lsu_mem_global_op_red.sum"]
    assert work.total(E.ATOMIC_REQUESTS) == pytest.approx(sectors, rel=0.01)
    path = shared / f"silicon/ids/{name}_{width}.npz"
    if path.exists():  # as many pixels differ from cudaraster's as differed on the GPU
        ids = np.load(path)["id"].astype(int) - 1
        assert np.count_nonzero(ids != frame.ids) == gpu["stats/id_diff_pixels"]
