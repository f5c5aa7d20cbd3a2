"""Roads not taken in shading: each experiment runs in small, draws, and says what its numbers say."""

import numpy as np
import pytest

from tests.roads import check_in_small
from tilestamp.experiments.exploration import compaction, decoupled, derivatives, quad_merging
from tilestamp.experiments.stability import merged_quads

SMALL = {
    decoupled: {
        "SIDE": 24,
        "SAMPLES": 4,
        "AREAS": (10.0, 100.0),
        "CACHES": (1, 16, 1024),
        "FRAME": {"width": 32, "height": 24, "edge": 8.0},
    },
    compaction: {"SIDE": 32, "LAYERS": (1, 4), "SHARES": (0.0, 0.75)},
    derivatives: {"TILTS": (0.0, 0.8, 0.95), "AREAS": (4.0, 100.0), "WIDTH": 48, "HEIGHT": 36},
    quad_merging: {
        "AREAS": (0.5, 10.0),
        "ENTRIES": (1, 32),
        "SIDE": 24,
        "FRAME": {"width": 40, "height": 30, "spp": 4, "stamp": 2, "triangles": True},
    },
}


@pytest.mark.parametrize("road", SMALL, ids=lambda module: module.__name__.rpartition(".")[2])
def test_a_road_has_cells_sentences_and_pictures(road, monkeypatch, tmp_path):
    check_in_small(road, SMALL[road], monkeypatch, tmp_path)


@pytest.mark.parametrize(("spp", "aim"), [(4, 0.17), (16, 0.15)])
def test_merging_divides_shading_of_pixel_sized_triangles_by_about_eight(spp, aim):
    polygons = quad_merging.mesh(0.5)
    factor = quad_merging.shaded(polygons, spp, 0)[0] / quad_merging.shaded(polygons, spp, 32)[0]
    assert factor == pytest.approx(quad_merging.PUBLISHED, rel=aim)


def test_a_mesh_covers_every_sample_once():
    assert quad_merging.shaded(quad_merging.mesh(2.0), 16, 0)[1].min() >= 1


@pytest.mark.parametrize(("spp", "holds", "breaks"), [(4, 15.0, 19.0), (16, 21.0, 27.0)])
def test_creases_show_merged_quads_from_about_twenty_degrees_on(spp, holds, breaks):
    off = [np.abs(np.subtract(*map(np.int64, merged_quads.pictures(fold, spp)))).max() for fold in (holds, breaks)]
    assert off[0] <= merged_quads.WRONG < off[1]


def test_at_one_sample_a_pixel_no_crease_shows():
    plain, merged = merged_quads.pictures(80.0, 1)
    assert (plain == merged).all()
