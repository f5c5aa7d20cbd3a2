"""Every event of Zhang's kernels by hand: 40 triangles, each the lower left half of 48 x 48 pixels, diagonal included.

A triangle covers 48 * 49 / 2 = 1176 pixels, 300 quads, and meets 26 of the 36 tiles (those with i + j <= 6), three of
which, (1, 1), (1, 2) and (2, 1), lie wholly inside. The last eight triangles lie behind the others. The second warp of
the coarse rasterizer has them, beside the first one, so that Hi-Z rejects none; early z rejects all.
"""

import numpy as np
import pytest

from tests.test_counts_of_warps import nonzero
from tilestamp import simulate
from tilestamp.models.machine import load_machine
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.zhang2025.depth import depth_24_bit
from tilestamp.simulator.stages.zhang2025.frame_clears import cleared_bytes
from tilestamp.simulator.stages.zhang2025.primitive_binning import PrimitiveBinningEvent, primitive_binning

SIDE, NEAR, FAR = 48, 32, 8
TILES, MET, INSIDE, PIXELS, QUADS = 36, 26, 3, 1176, 300
COUNT = NEAR + FAR
PAIRS = 3 + 3 + 3 + 2 + 2 + 1  # of neighbouring tiles, one at least of which is met


def halves(textured=False, near=NEAR):
    count = near + FAR
    corners = np.tile(np.float32([[-1, -1], [1, -1], [-1, 1]]), (count, 1))
    z = np.repeat(np.float32([0.0] * near + [0.5] * FAR), 3)
    positions = np.column_stack([corners, z, np.ones(3 * count, np.float32)])
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    mesh = Mesh(positions, triangles)
    if textured:
        texture = np.full((4, 4, 4), 255, np.uint8)
        uvs, ids = np.full((3 * COUNT, 2), 0.5, np.float32), np.zeros(COUNT, np.int32)
        mesh = Mesh(positions, triangles, uvs=uvs, texture_ids=ids, textures=(texture,))
    return Scene("halves", mesh=mesh)


def works(textured=False, **options):
    return drawn(halves(textured), **options)


def drawn(scene, **options):
    """Works by stage."""
    run = simulate(scene, "binned", "h200", width=SIDE, height=SIDE, camera=np.eye(4), **options)
    return {work.stage: work for work in run.frame.works}


@pytest.fixture(scope="module")
def made():
    return works()


def sectors(**counts):
    """Loads and stores of so many sectors of 32 bytes."""
    moved = {f"{kind.upper()}_TRANSACTIONS": n for kind, n in counts.items()}
    return moved | {f"{kind.upper()}_BYTES": 32 * n for kind, n in counts.items()}


def atomics(count):
    """Instructions of one lane each."""
    return dict.fromkeys(("ATOMIC", "ATOMIC_LANES", "ATOMIC_REQUESTS", "ATOMIC_DEPTH"), count)


def test_primitive_assembly(made):
    """Each lane's vertices are its own, nine words each, beside three of indices; a primitive is 28 words."""
    expected = {"WARPS": 2, "WARP_LANES": COUNT, "PIECES": COUNT}
    indices = 3 * (32 * 12 // 32 + 8 * 12 // 32)
    moved = sectors(load=3 * 9 * COUNT + indices, store=28 * COUNT)
    assert nonzero(made["PrimitiveAssembly"].counts()) == expected | moved


def test_only_triangles_that_are_cut_into_pieces_take_further_slots():
    """One whole, one outside, one of which a corner is left, one that loses a corner, and one that faces away."""
    corners = [
        [(-0.5, -0.5), (0.5, -0.5), (0.0, 0.5)],
        [(2.0, 0.0), (3.0, 0.0), (2.0, 1.0)],
        [(0.5, 0.0), (1.5, -0.2), (1.5, 0.2)],
        [(0.0, 0.0), (1.5, 0.0), (0.0, 0.5)],
        [(-0.5, -0.5), (0.0, 0.5), (0.5, -0.5)],
    ]
    positions = np.concatenate([np.reshape(corners, (15, 2)), np.tile([0.0, 1.0], (15, 1))], axis=1)
    mesh = Mesh(positions.astype(np.float32), np.arange(15, dtype=np.int32).reshape(-1, 3))
    counts = drawn(Scene("five", mesh=mesh))["PrimitiveAssembly"].counts()
    pieces = 1 + 1 + 1 + 2 + 1  # of the outside one, the mark in its slot
    assert {name: n for name, n in nonzero(counts).items() if "TRANS" not in name and "BYTES" not in name} == {
        "WARPS": 1, "WARP_LANES": 5, "CLIPPED": 1, "CULLED": 2, "PIECES": pieces, "CLIP_WARPS": 1, **atomics(1),
    }  # fmt: skip


def test_primitive_compaction(made):
    """A launch covers four slots a triangle: 160, one block of 8 warps, each of which reads the numbers of 32."""
    expected = {"WARPS": 8, "KEPT": COUNT, "GRID_SYNC": 2, "KEPT_WARPS": 2, "BLOCKS": 1, **atomics(2)}
    loads = 8 * 32 + 28 * COUNT
    assert nonzero(made["PrimitiveCompaction"].counts()) == expected | sectors(load=loads, store=28 * COUNT)


def test_triangle_setup(made):
    """Eight blocks of eight warps, two of which have primitives; a whole warp's words are a sector each."""
    expected = {"WARPS": 2, "WARP_LANES": COUNT, "BLOCKS": 1, "IDLE_WARPS": 62}
    assert nonzero(made["TriangleSetup"].counts()) == expected | sectors(load=2 * 32 * 28, store=2 * 32 * 35)
    moved = {stream.op: stream.bytes for stream in made["TriangleSetup"].streams}
    assert moved == {"load": COUNT * 112, "store": 32 * 2 * 32 * 35}


def test_a_frame_clears_what_the_authors_program_does():
    """Bytes of the memsets of a frame of 968 triangles at 1920x1080, as they were traced on an H200."""
    traced = [4] * 5 + [4096, 262144, 433664, 1048576, 2095104, 8294400, 8294400, 33177600, 398131200]
    assert sorted(cleared_bytes(968, 1920 * 1080).values()) == traced


def test_primitive_binning(made):
    """Eight blocks, for as many as compaction may leave; each stores two words of 256 queues, 32 sectors each.

    All warps read how many there are; of one bin, 40 entries in a row are five sectors.
    """
    expected = {"WARPS": 64, "WARP_LANES": COUNT, "BIN_STEPS": 2, "ENTRIES": COUNT, "CHUNKS": 1} | atomics(8)
    expected |= {"LIVE_WARPS": 2, "BIN_LANES": COUNT, "BASE_SECTORS": 2, "ENTRY_SECTORS": 5}
    moved = sectors(load=6 * COUNT + 2 + 64, store=5 + 8 * 64)
    assert nonzero(made["PrimitiveBinning"].counts()) == expected | moved


def test_bins_that_share_a_sector_of_bases_and_the_entries_of_each():
    """Boxes of bins 0 and 1; 1; 0 to 2: in the first step bins 0, 1, 0, then 1, 1, and 2."""
    boxes = np.float32([[10, 10, 200, 20], [150, 10, 200, 20], [10, 10, 300, 20]])
    table = primitive_binning(boxes, 512, 512, load_machine("h200").simt).works[0]
    event = PrimitiveBinningEvent
    got = [table.total(e) for e in (event.BIN_STEPS, event.BIN_LANES, event.BASE_SECTORS, event.ENTRY_SECTORS)]
    assert got == [3, 6, 3, 2 + 1 + 1]


def test_coarse_rasterizer(made):
    entries = MET * COUNT
    expected = {
        "ROUNDS": 1,
        "WARPS": 2,
        "WARP_LANES": COUNT,
        "EDGE_STEPS": 2 * TILES,
        "EDGE_LANES": TILES * COUNT,
        "HI_Z_STEPS": 2 * MET,
        "HI_Z_LANES": MET * COUNT,
        "HI_Z_UPDATES": INSIDE * COUNT,
        "KEPT_STEPS": 2 * MET,
        "KEPT_LANES": MET * COUNT,
        "APPEND_STEPS": 3 * COUNT,  # two rows of tiles a warp
        "CHUNK_STEPS": 3,
        "CHUNK_SECTORS": PAIRS,
        "ENTRIES": entries,
        "SHARED_ATOMIC": 2 * INSIDE,
        "BANK_REPLAYS": INSIDE * (COUNT - 2),  # at one address
        "SUB_QUEUES": 1,
        "FILLS": 1,
        "BLOCKS": 1,
        "CRITICAL_HI_Z_STEPS": MET,
        "CRITICAL_UPDATE_STEPS": INSIDE,
        "CRITICAL_APPEND_STEPS": COUNT,
        **atomics(1),
        # 16 words of a primitive and its number; where a queue begins and how long it is, twice; depths of 256 tiles;
        # the number of primitives, for eight warps
        **sectors(load=16 * COUNT + 5 + 3 * PAIRS + 2 + 32 + 8, store=entries + 3 * PAIRS + 32),
    }
    assert nonzero(made["CoarseRasterizer"].counts()) == expected


def test_hi_z_rejects_what_lies_behind_a_round_before():
    """With 256 in front, a round, those behind are in the next."""
    counts = drawn(halves(near=256))["CoarseRasterizer"].counts()
    assert counts["HI_Z_REJECTED"] == INSIDE * FAR
    assert counts["ENTRIES"] == MET * 256 + (MET - INSIDE) * FAR


@pytest.mark.small
def test_a_depth_that_is_no_number_is_nearest():
    """As conversions of the original's machine do."""
    assert depth_24_bit(np.float32(np.nan)) == 0


@pytest.mark.parametrize(("faults", "margin"), [(True, 0), (False, 4)])
def test_hi_z_has_a_margin_unless_it_is_as_in_the_original(faults, margin):
    """Of depths that are equal the original rejects the later; here they may lie 4 units behind."""
    equal = drawn(halves(near=256 + 8), original_faults=faults)["CoarseRasterizer"].counts()
    assert equal["HI_Z_REJECTED"] == INSIDE * (FAR + (8 if margin == 0 else 0))


def test_fine_rasterizer(made):
    lanes, rounds = MET * COUNT, 2 * MET
    hits, quads, groups = PIXELS * COUNT, QUADS * NEAR, 5 * MET
    expected = {
        "WARPS": TILES,
        "ROUNDS": rounds,
        "ROUND_LANES": lanes,
        "SAMPLE_TESTS": 64 * lanes,
        "SAMPLE_HITS": hits,
        "EARLY_Z_STEPS": 2 * PIXELS,
        "QUAD_STEPS": 4 * QUADS,  # eight primitives at once
        "QUADS": quads,
        "QUAD_LANES": 4 * quads,
        "GROUP_STEPS": groups,
        "GROUP_LANES": 4 * lanes,
        "SHARED_ATOMIC": 2 * PIXELS,
        "BANK_REPLAYS": hits - 2 * PIXELS,
        # of four rows of tiles in a column, the one with most: five whole ones and one cut in half (36 pixels, 10
        # quads); of the two rows left a whole one, one cut in half, and one that is met in a corner
        "CRITICAL_ROUNDS": 2 * 6 + 2 * 3,
        "CRITICAL_Z_STEPS": 2 * (5 * 64 + 36 + 64 + 36),
        "CRITICAL_QUAD_STEPS": 4 * (5 * 16 + 10 + 16 + 10),
        **atomics(rounds),
        # depths, queues, eight numbers of primitives a sector; words for coverage, for quads, and at each pixel
        **sectors(load=(8 + 2) * TILES + groups + (9 + 22) * lanes + 3 * hits, store=8 * TILES + 4 * 4 * quads),
    }
    assert nonzero(made["FineRasterizer"].counts()) == expected


@pytest.mark.parametrize("textured", [False, True])
def test_pixel_shader(textured):
    """8 quads a warp; blocks for three fragments a pixel, or so; trilinear: 8 loads of one texel each.

    A whole tile is two warps of four rows of 8 pixels, which share a request each. Of a tile cut in half, 4, 3, 2 and
    1 quads in its rows go round in five warps, which meet 3, 4, 4, 4 and 4 rows of quads.
    """
    work = works(textured)["PixelShader"]
    warps = QUADS * NEAR // 8
    texels = 8 * warps * textured
    assert nonzero(work.counts()) == nonzero({
        "WARPS": warps, "WARP_LANES": 32 * warps, "EMPTY_WARPS": 8 * work.grid - warps, "TEXEL_LOADS": texels,
        "TEXEL_LANES": 32 * texels, "TEXTURE_TRANSACTIONS": texels, "TEXTURE_BYTES": 32 * texels, "ATOMIC": warps,
        "ATOMIC_LANES": 32 * warps, "ATOMIC_DEPTH": warps, "TEXTURED_WARPS": textured * warps,
        "MAGNIFIED_WARPS": textured * warps,
        "ATOMIC_REQUESTS": NEAR * 15 * 2 * 4 + 6 * NEAR * 10 // 40 * 2 * (3 + 4 * 4),
        "WARPS_LAUNCHED": 8 * work.grid,
        **sectors(load=(96 - 32 * textured) * warps + texels + 8 * work.grid, store=64 * warps),
    })  # fmt: skip


def test_rop(made):
    """Four fragments a pixel are kept; warps of two rows of 16 pixels, 48 of 72 with a quad that is drawn."""
    lists, blends = 4 * QUADS * NEAR, 4 * PIXELS
    expected = {
        "WARPS": 72,
        "WARP_LANES": SIDE * SIDE,
        "LIST_STEPS": 48 * NEAR,
        "LIST_LANES": lists,
        "SORT_STEPS": 48 * 6,
        "BLEND_STEPS": 48 * 4,
        "BLEND_LANES": blends,
        "LOST": (NEAR - 4) * PIXELS,
        "LIST_WARPS": 48,
        "LIST_WARP_LANES": 4 * QUADS,
        "SORT_LANES": 6 * PIXELS,
        **sectors(load=lists + 2 * blends + 24 * 72, store=20 * 72),
    }
    assert nonzero(made["ROP"].counts()) == expected
