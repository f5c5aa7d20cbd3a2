"""Speed of the micropolygon pipeline, by ``pytest tests/benchmarks --benchmark-only``: reported, never asserted."""

import os
from functools import cache

import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions, micropolygon
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles

GT200 = Simt(32, Coalescing.HALF_WARP_SEGMENTS, 16, 16, AtomicMerge.NONE, 30)
SIZE = (1600, 1200)
SCENE = os.environ.get("TILESTAMP_BENCHMARK_SCENE", "killeroo")


@cache
def scene_and_matrix():
    try:
        scene = load_scene(SCENE)
    except TilestampError as error:
        pytest.skip(str(error))
    return scene, read_camera("default", scene).matrix(*SIZE)


@cache
def grids():
    scene, matrix = scene_and_matrix()
    subpatches, _, _ = bound_and_split(scene.patches.points, matrix, *SIZE, 4, GT200, counting=False)
    return dice(scene.patches.points, subpatches, matrix, *SIZE, GT200, counting=False)[0]


@pytest.mark.parametrize("tile", [4, 8, 32])
def test_bucket_count_with_every_conflict(benchmark, tile):
    boxes, tiles = grids().boxes, screen_tiles(*SIZE, tile, 4)
    benchmark.extra_info["subpatches"] = len(boxes)
    benchmark.pedantic(bucket_count, (boxes, tiles, GT200), rounds=10, warmup_rounds=1)


@pytest.mark.parametrize("counting", [True, False])
@pytest.mark.parametrize("spp", [1, 4])
def test_frame(benchmark, spp, counting):
    scene, matrix = scene_and_matrix()
    options = MicropolygonOptions(spp=spp)

    def draw():
        return micropolygon(scene, matrix, *SIZE, GT200, options, Executor(counting=counting))

    frame = benchmark.pedantic(draw, rounds=5, warmup_rounds=1)
    benchmark.extra_info.update({key: frame.facts[key] for key in ("subpatches", "patches_written")})
