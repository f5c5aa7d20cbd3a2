"""Every event of Zhang's kernels by hand: 40 triangles, each the lower left half of 48 x 48 pixels, diagonal included.

A triangle covers 48 * 49 / 2 = 1176 pixels, 300 quads, and meets 26 of the 36 tiles (those with i + j <= 6), three of
which, (1, 1), (1, 2) and (2, 1), lie wholly inside. The last eight triangles lie behind the others: the second warp
of the coarse rasterizer rejects them in those three tiles, and early z everywhere else.
"""

import numpy as np
import pytest

from tests.test_counts_of_warps import nonzero
from tilestamp import simulate
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.scene import Scene

SIDE, NEAR, FAR = 48, 32, 8
TILES, MET, INSIDE, PIXELS, QUADS = 36, 26, 3, 1176, 300
COUNT = NEAR + FAR
SETUP_WORDS, SETUP_SECTORS = 35, 5  # of a primitive


def halves(textured=False):
    corners = np.tile(np.float32([[-1, -1], [1, -1], [-1, 1]]), (COUNT, 1))
    z = np.repeat(np.float32([0.0] * NEAR + [0.5] * FAR), 3)
    positions = np.column_stack([corners, z, np.ones(3 * COUNT, np.float32)])
    triangles = np.arange(3 * COUNT, dtype=np.int32).reshape(-1, 3)
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
    """Each lane's vertices are its own, nine words each; a primitive is 28 words."""
    expected = {"WARPS": 2, "WARP_LANES": COUNT, "PIECES": COUNT}
    assert nonzero(made["PrimitiveAssembly"].counts()) == expected | sectors(load=3 * 9 * COUNT, store=28 * COUNT)


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
        "WARPS": 1, "WARP_LANES": 5, "CLIPPED": 1, "CULLED": 2, "PIECES": pieces, **atomics(1),
    }  # fmt: skip


def test_primitive_compaction(made):
    """A launch covers four slots a triangle: 160, one block of 8 warps, each of which reads the numbers of 32."""
    expected = {"WARPS": 8, "KEPT": COUNT, "GRID_SYNC": 2}
    loads = 8 * 32 + 28 * COUNT
    assert nonzero(made["PrimitiveCompaction"].counts()) == expected | sectors(load=loads, store=28 * COUNT)


def test_primitive_binning(made):
    """Eight blocks, for as many as compaction may leave; each stores two words of 256 queues, 32 sectors each."""
    expected = {"WARPS": 64, "WARP_LANES": COUNT, "BIN_STEPS": 2, "ENTRIES": COUNT, "CHUNKS": 1} | atomics(8)
    assert nonzero(made["PrimitiveBinning"].counts()) == expected | sectors(load=7 * COUNT, store=COUNT + 8 * 64)


def test_coarse_rasterizer(made):
    entries = MET * NEAR + (MET - INSIDE) * FAR
    expected = {
        "ROUNDS": 1,
        "WARPS": 2,
        "WARP_LANES": COUNT,
        "EDGE_STEPS": 2 * TILES,
        "EDGE_LANES": TILES * COUNT,
        "HI_Z_STEPS": 2 * MET,
        "HI_Z_LANES": MET * COUNT,
        "HI_Z_REJECTED": INSIDE * FAR,
        "HI_Z_UPDATES": INSIDE * NEAR,
        "APPEND_STEPS": 3 * COUNT,  # two rows of tiles a warp
        "ENTRIES": entries,
        "SHARED_ATOMIC": INSIDE,
        "BANK_REPLAYS": INSIDE * (NEAR - 1),  # at one address
        "SUB_QUEUES": 1,
        "FILLS": 1,
        "CRITICAL_HI_Z_STEPS": MET,
        "CRITICAL_APPEND_STEPS": COUNT,
        **atomics(1),
        **sectors(load=COUNT * (SETUP_WORDS + 1), store=entries),
    }
    assert nonzero(made["CoarseRasterizer"].counts()) == expected


def test_fine_rasterizer(made):
    lanes = MET * NEAR + (MET - INSIDE) * FAR
    rounds = MET + (MET - INSIDE)
    seen = PIXELS - 64 * INSIDE  # pixels of the far triangles in the tiles that list them
    hits = PIXELS * NEAR + seen * FAR
    quads = QUADS * NEAR
    expected = {
        "WARPS": TILES,
        "ROUNDS": rounds,
        "ROUND_LANES": lanes,
        "SAMPLE_TESTS": 64 * lanes,
        "SAMPLE_HITS": hits,
        "EARLY_Z_STEPS": PIXELS + seen,
        "QUAD_STEPS": 4 * QUADS,  # eight primitives at once
        "QUADS": quads,
        "SHARED_ATOMIC": PIXELS + seen,
        "BANK_REPLAYS": hits - PIXELS - seen,
        # of four rows of tiles in a column, the one with most: five whole ones and one cut in half (36 pixels, 10
        # quads); of the two rows left a whole one, one cut in half, and one that is met in a corner
        "CRITICAL_ROUNDS": 2 * 6 + 2 * 3,
        "CRITICAL_Z_STEPS": 2 * (5 * 64 + 36 + 64 + 36),
        "CRITICAL_QUAD_STEPS": 4 * (5 * 16 + 10 + 16 + 10),
        **atomics(rounds),
        **sectors(
            load=8 * TILES + lanes * SETUP_WORDS + quads * SETUP_SECTORS + 4 * rounds,
            store=8 * TILES + quads * 4 * 48 // 32,
        ),
    }
    assert nonzero(made["FineRasterizer"].counts()) == expected


@pytest.mark.parametrize("textured", [False, True])
def test_pixel_shader(textured):
    """8 quads a warp; blocks for three fragments a pixel, or so; trilinear: 8 loads of one texel each."""
    work = works(textured)["PixelShader"]
    warps = QUADS * NEAR // 8
    texels = 8 * warps * textured
    assert nonzero(work.counts()) == nonzero({
        "WARPS": warps, "WARP_LANES": 32 * warps, "EMPTY_WARPS": 8 * work.grid - warps, "TEXEL_LOADS": texels,
        "TEXEL_LANES": 32 * texels, "TEXTURE_TRANSACTIONS": texels, "TEXTURE_BYTES": 32 * texels, "ATOMIC": warps,
        "ATOMIC_LANES": 32 * warps, "ATOMIC_REQUESTS": 16 * warps, "ATOMIC_DEPTH": warps,
        **sectors(load=64 * warps + texels, store=64 * warps),
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
        **sectors(load=lists + 2 * blends + 24 * 72, store=20 * 72),
    }
    assert nonzero(made["ROP"].counts()) == expected
