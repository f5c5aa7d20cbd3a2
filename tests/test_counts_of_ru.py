"""Every event of Ru's kernels against Python; what is the same for every thread, by hand."""

import numpy as np
import pytest

from tests import naive_ru
from tests.test_counts_of_warps import nonzero
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.scenes.texture import texture_chains
from tilestamp.simulator.stages.ru2016.fragment_shading_work import shading_work
from tilestamp.simulator.stages.ru2016.per_primitive_raster import per_primitive_raster
from tilestamp.simulator.stages.ru2016.tile_lists import tile_lists
from tilestamp.simulator.stages.ru2016.tile_lists_fill import edges_tried
from tilestamp.simulator.stages.ru2016.tile_lists_warps import walkers
from tilestamp.simulator.stages.ru2016.tiled_raster import tiled_raster
from tilestamp.simulator.stages.thread_per_item import Access, ThreadEvent, thread_per_item

KEPLER = Simt(coalescing=Coalescing.WARP_LINES, atomic_merge=AtomicMerge.SECTOR, sms=8)
HOPPER = Simt(coalescing=Coalescing.WARP_SECTORS, atomic_merge=AtomicMerge.SECTOR)
WIDTH, HEIGHT = 29, 19
by_machine = pytest.mark.parametrize("simt", [KEPLER, HOPPER], ids=["kepler", "hopper"])


def soup(count=170, seed=6):
    """Triangles of a few pixels on and beside the screen, turned either way."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-4, [WIDTH + 4, HEIGHT + 4], (count, 1, 2)) + rng.uniform(-5, 5, (count, 3, 2))
    screen = np.ones((3 * count, 4), np.float32)
    screen[:, :2] = places.reshape(-1, 2)
    screen[:, 2] = rng.uniform(0.05, 0.95, 3 * count)
    return screen, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@by_machine
@pytest.mark.parametrize(("culling", "textured"), [(True, False), (False, True)])
def test_per_primitive_raster(culling, textured, simt):
    screen, triangles = soup()
    every = np.arange(len(triangles), dtype=np.int32)
    mapped = every % 3 == 0 if textured else None
    _, (work,), _ = per_primitive_raster(
        screen, triangles, every, WIDTH, HEIGHT, simt, culling=culling, textured=mapped
    )
    named = {tuple(map(int, t)) for t in triangles[::3]} if textured else set()
    expected = naive_ru.per_primitive(screen, triangles, WIDTH, HEIGHT, simt, culling=culling, textured=named)
    assert nonzero(work.counts()) == nonzero(expected)


@by_machine
@pytest.mark.parametrize("culling", [True, False])
def test_tile_lists(culling, simt):
    screen, triangles = soup()
    every = np.arange(len(triangles), dtype=np.int32)
    _, (counting, _, filling), _ = tile_lists(
        screen, triangles, every, WIDTH, HEIGHT, simt, tile=8, culling=culling, capacity="safe"
    )
    order = walkers((len(triangles) + 128) // 32, 32).order.tolist()
    given = (screen, triangles, WIDTH, HEIGHT, 8, simt, edges_tried, order)
    for work, fills in ((counting, False), (filling, True)):
        expected, _ = naive_ru.tile_lists(*given, culling=culling, filling=fills)
        assert nonzero(work.counts()) == nonzero(expected)


@by_machine
@pytest.mark.parametrize("tile", [4, 8])
def test_tiled_raster(tile, simt):
    screen, triangles = soup(60)
    every = np.arange(len(triangles), dtype=np.int32)
    lists, _, _ = tile_lists(screen, triangles, every, WIDTH, HEIGHT, simt, tile=tile, culling=True, capacity="safe")
    _, (work,), _ = tiled_raster(screen, triangles, lists, WIDTH, HEIGHT, simt, tile=tile)
    entries = [[tuple(map(int, triangles[t])) for t in part] for part in np.split(lists.entries, lists.starts[1:-1])]
    counts = {event: n for event, n in work.counts().items() if not event.startswith("STORE")}
    assert nonzero(counts) == nonzero(naive_ru.tiled_raster(screen, entries, WIDTH, HEIGHT, tile, simt))


def test_a_tile_stores_a_fragment_in_seven_pairs_of_words():
    """8 x 8: rows of 8 fragments 56 bytes apart, a sector for each pair, as an H200 counts them."""
    screen, triangles = soup(1)
    lists, _, _ = tile_lists(
        screen, triangles, np.zeros(1, np.int32), 8, 8, HOPPER, tile=8, culling=True, capacity="safe"
    )
    _, (work,), _ = tiled_raster(screen, triangles, lists, 8, 8, HOPPER, tile=8)
    event = work.events
    assert work.total(event.STORE_TRANSACTIONS) == 2 * (7 * 32 + 4)  # of 32 lanes; depth in 4 rows of 32 bytes
    assert work.total(event.STORE_BYTES) == 32 * work.total(event.STORE_TRANSACTIONS)


def test_one_thread_an_item_by_hand():
    """300 items in blocks of 256, and two blocks that find none: 8 words of 4 bytes a record, then one of 16."""
    accesses = (Access("in", 32, 8),), (Access("out", 16, 1, 16),)
    work = thread_per_item("s", "k", 300, 256, HOPPER, *accesses, idle_blocks=2)
    E = ThreadEvent
    assert work.table[:, [E.WARPS, E.WARP_LANES, E.BLOCKS]].tolist() == [[8, 256, 1], [2, 44, 1], [0, 0, 0], [0, 0, 0]]
    assert work.table[:, E.LOAD_TRANSACTIONS].tolist() == [8 * 8 * 32, 2 * 8 * 32, 0, 0]
    assert work.table[:, E.LOAD_BYTES].tolist() == [32 * n for n in work.table[:, E.LOAD_TRANSACTIONS].tolist()]
    assert work.table[:, E.STORE_TRANSACTIONS].tolist() == [8 * 16, 2 * 16, 0, 0]
    assert work.table[:, E.STORE_BYTES].tolist() == [8 * 512, 2 * 512, 0, 0]


def test_shading_two_blocks_by_hand():
    """16 x 8 pixels. Block 0: 5 fragments in its upper warp, 3 of them textured, one texel; block 1: nothing."""
    drawn = np.zeros((8, 16), bool)
    textures = np.full((8, 16), -1, np.int32)
    drawn[0, :5], textures[0, :3] = True, 0
    chains = texture_chains((np.zeros((4, 4, 4), np.uint8),), tile=0, mips=False)
    uvs = np.zeros((8, 16, 2), np.float32)
    for texture_filter, texels in (("nearest", 1), ("bilinear", 4)):
        work = shading_work(drawn, textures, uvs, chains, texture_filter, HOPPER)
        words = 32 * (1 * 4 + 5 * 1 + 4 * 1)  # a word of a fragment is a sector a lane: look, light, texture
        assert nonzero(work.counts()) == {
            "BLOCKS": 2, "WARPS": 4, "WARP_LANES": 128, "DRAWN_WARPS": 1, "DRAWN_LANES": 5, "DRAWN_BLOCKS": 1,
            "TEXTURED_WARPS": 1, "TEXTURED_LANES": 3, "TEXTURED_BLOCKS": 1,
            "LOAD_TRANSACTIONS": words + 3 * texels, "LOAD_BYTES": 32 * words + 128 * 3 * texels,
            "ZERO_TEXELS": 3 * texels, "ZERO_LANES": 3 * 3 * texels,
            "STORE_TRANSACTIONS": 3 * 12, "STORE_BYTES": 3 * 12 * 32,  # 384 bytes of colours, three words a pixel
        }  # fmt: skip
