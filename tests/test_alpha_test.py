"""The alpha test of fine raster: pictures and every event against Python, and what compaction may not change."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_alpha, naive_blend, naive_fine
from tests.test_counts_of_warps import nonzero
from tests.test_fine_raster import mesh_soup
from tilestamp.experiments.frontier.methods_scenes import sheets
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.laine2011.alpha_test import AlphaEvent, alpha_test

SIZE, REFERENCE = (16, 8), 0.5
SIMT = Simt(coalescing=Coalescing.WARP_SECTORS, sms=2)
WARPS = {False: 20, True: 18}  # 48 KB of shared memory, of which each waiting fragment takes 4 bytes


def soup(count=90, seed=2):
    positions, triangles = mesh_soup(seed, count=count, spread=1.2, near=0.3)
    colors = np.random.default_rng(seed).random((len(positions), 4)).astype(np.float32)
    positions[30:33] = [[-4, -4, -0.6, 1], [8, -4, -0.6, 1], [-4, 8, -0.6, 1]]  # over all tiles, opaque
    colors[30:33, 3] = 1.0
    return positions, triangles, colors


def draw(scene, compact, reference=REFERENCE):
    positions, triangles, colors = scene
    setup, lists = naive_blend.prepared(positions, triangles, SIZE)
    buffers, (work,), _ = alpha_test(
        setup, *lists, *SIZE, SIMT, reference=reference, compact=compact, colors=colors
    )  # fmt: skip
    return setup, lists, buffers, work


@pytest.mark.parametrize("compact", [False, True])
@pytest.mark.parametrize("reference", [0.0, 0.3, 0.5, 0.9])
def test_the_nearest_fragment_that_is_kept_shows(reference, compact):
    scene = soup(40)
    _, _, buffers, _ = draw(scene, compact, reference)
    wanted = naive_alpha.picture(naive_blend.fragments(*scene, SIZE), round(255 * reference))
    found = {(y, x): (buffers.ids[0, y, x], int(buffers.color[0, y, x])) for y, x in np.argwhere(buffers.ids[0] >= 0)}
    assert found == wanted


@pytest.mark.parametrize("compact", [False, True])
def test_every_event_is_that_of_python(compact):
    scene = soup()
    setup, lists, _, work = draw(scene, compact)
    alpha = {
        (triangle, x, y): color >> 24
        for (y, x), found in naive_blend.fragments(*scene, SIZE).items()
        for color, _, triangle in found
    }
    test = naive_alpha.Test(alpha, round(255 * REFERENCE), compact)
    job = naive_fine.Job(setup, *SIZE, SIMT, False, 1, True, False, True, True)
    expected = naive_fine.fine(job, *lists, naive_alpha.tile_with(test), WARPS[compact])
    assert expected["DISCARDS"] > 0
    assert expected["EARLY_Z_KILLS"] > 0
    assert nonzero(work.counts()) == nonzero(expected)


def leaves(seed, area=20.0, count=2):
    """Sheets whose corners have an alpha at random."""
    scene = sheets(area, 48, 36, count=count, seed=seed)
    scene.mesh.colors[:, 3] = np.random.default_rng(seed).random(len(scene.mesh.colors))
    return scene


def render(scene, **options):
    return simulate(
        scene, "cudaraster", "gtx480", width=48, height=36, camera=np.eye(4), cull_backfaces=False, **options
    )


@given(st.integers(0, 1000), st.floats(0, 1))
@settings(max_examples=15, deadline=None)
def test_compaction_changes_neither_picture_nor_what_is_shaded(seed, reference):
    plain, packed = (render(leaves(seed), alpha_test=reference, compact=way) for way in (False, True))
    assert (plain.image == packed.image).all()
    lanes, rounds = (
        [run.counts[f"fine_raster.SHADE_{name}"] for run in (plain, packed)] for name in ("LANES", "ROUNDS")
    )
    assert lanes[0] == lanes[1]
    assert rounds[1] <= rounds[0]


@pytest.mark.parametrize("compact", [False, True])
def test_where_nothing_is_discarded_the_picture_is_that_without_a_test(compact):
    plain, tested = render(leaves(1)), render(leaves(1), alpha_test=0.0, compact=compact)
    assert (plain.image == tested.image).all()
    assert tested.counts["fine_raster.DISCARDS"] == 0


def test_compacted_rounds_are_full_but_for_the_last_of_a_tile():
    run = render(leaves(3), alpha_test=0.5, compact=True)
    work = run.frame.works[-1]
    lanes, rounds = (work.table[:, AlphaEvent[f"SHADE_{name}"]] for name in ("LANES", "ROUNDS"))
    assert (rounds == -(-lanes // 32)).all()


@pytest.mark.parametrize(
    "options", [{"mode": "blend"}, {"msaa": 4}, {"release": "nvdiffrast"}, {"batches": 2}], ids=lambda o: next(iter(o))
)
def test_other_draws_have_no_alpha_test(options):
    with pytest.raises(TilestampError, match="alpha_test"):
        CudarasterOptions(alpha_test=0.5, **options)
