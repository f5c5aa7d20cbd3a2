"""Heat maps lie over the picture, whether or not its size is a multiple of the tile."""

import numpy as np
import pytest

from tilestamp.reports.heatmap import extent
from tilestamp.simulator.simulation import simulate

WIDTH, HEIGHT = 100, 75  # 4 and 3 pixels over whole tiles


@pytest.mark.parametrize(
    ("pipeline", "scene", "counter", "options"),
    [
        ("micropolygon", "teapot", "quads", {"tile": 8}),
        ("cudaraster", "spot", "tile_triangles", {}),
        ("tiled", "spot", "list length", {"tile": 8}),
        ("binned", "spot", "tile queue", {}),
    ],
)
def test_every_pixel_that_is_drawn_lies_in_a_cell_that_counts_something(pipeline, scene, counter, options):
    run = simulate(scene, pipeline, "h200", width=WIDTH, height=HEIGHT, **options)
    frame = run.frame
    cells = frame.maps[counter] > 0
    left, _, bottom, top = extent(cells.shape, HEIGHT, frame.tile, from_below=frame.tiles_from_below)
    by_pixel = np.kron(cells, np.ones((frame.tile, frame.tile), bool))
    assert left == 0
    assert bottom - top == len(by_pixel)
    on_screen = by_pixel[-top:][:HEIGHT, :WIDTH] if top else by_pixel[:HEIGHT, :WIDTH]
    drawn = frame.triangle_ids >= 0 if frame.triangle_ids is not None else run.depth < 1
    assert drawn.any()
    assert not on_screen.all()
    assert not (drawn & ~on_screen).any()
    shifted = by_pixel[:HEIGHT, :WIDTH] if top else by_pixel[-HEIGHT:, :WIDTH]
    assert (drawn & ~shifted).any()  # the other way round they would not


def test_cells_of_a_pixel_fill_the_screen():
    assert extent((HEIGHT, WIDTH), HEIGHT, 1, from_below=False) == (0, WIDTH, HEIGHT, 0)


@pytest.mark.parametrize(("from_below", "rows"), [(False, (80, 0)), (True, (75, -5))])
def test_cells_stick_out_at_the_end_that_they_do_not_begin_at(from_below, rows):
    assert extent((10, 13), HEIGHT, 8, from_below=from_below) == (0, 104, *rows)
