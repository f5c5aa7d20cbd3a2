"""Which basic blocks of CudaRaster's machine code one event runs.

Addresses are those of ``RasterImpl.cu`` of nvdiffrast as nvcc 13.0.88 compiles it for sm_90 with default flags, each
kernel's from 0; registers (70, 48, 70, 56) and shared memory are those of the measured program. Two lines of the
source were changed as for the measured variant no_param_copy: the parameters of image 0 are named instead of indexed,
and setup takes the fast path inside the whole frustum only. Which source line a block comes from, ``nvcc -lineinfo``
and ``nvdisasm -gi`` say; each was then given to the event of the stage that counts how often that line runs.
"""

from typing import NamedTuple


class Run(NamedTuple):
    """Blocks that run together."""

    addresses: tuple[int, ...]
    times: float = 1.0  # warps that run them, an event
    lanes: int = 32


def at(addresses: str, times: float = 1.0, lanes: int = 32) -> tuple[Run, ...]:
    """Blocks that run together, by their addresses in hexadecimal."""
    return (Run(tuple(int(a, 16) for a in addresses.split()), times, lanes),)


Events = dict[str, tuple[Run, ...]]
BLOCK = 16  # warps of a block of bin and coarse raster
TILES = 8  # warps with a tile of a bin each
_DRAW = "ad0 b40 b80"  # of fine raster
_SORT = (
    "570 620 640 6a0 700 720 7c0 7e0 840 860 900 920 980 9a0 a40 a60 ac0 ae0 b80 ba0 c00 c20 cc0 ce0 d40 d60 e00 e20"
    " e80 ea0 f40 f60 fc0 fe0 1000"
)
RUNS: dict[str, Events] = {
    "triangleSetup": {
        "WARPS": at("0 90 1f0 300 410"),
        "OUTSIDE_WARPS": at("650"),
        "CULLED_WARPS": at("eff0"),
        "SNAP_WARPS": at("7b0"),
        "FAST_WARPS": at("d720 d810 d850 d960 d9a0 daa0 dae0 de50 dea0 dfb0 e2f0 e300"),
        "SITE_WARPS": at("e010"),
        "RETEST_WARPS": at("e180 e1a0", lanes=8),  # assumed: few miss
        "STORE_STEPS": at("e3f0 e660 e6a0"),
        "CLIP_WARPS": at("860 6e50 ae30 af10 af50 bba0 bd80 bdb0 be90"),
        "CLIP_STEPS": at("1bd0 1e10 1ee0"),
        "FAN_STEPS": at("b040 b1c0 b200 b2a0 b2e0 b6b0 b700 b800 bb70 bfb0 c160 c1a0 c240 c280 c640 c680 c770"),
    },
    "binRaster": {
        "CTA_STARTS": at("0 90 280 3e0 470 3960", BLOCK) + at("410", lanes=1),
        "CTA_BIN_WARPS": at("190 3990"),
        "BATCHES": at("3e0 470 510 3830 3940", BLOCK) + at("410", lanes=1),
        "CLOSING_WARPS": at("3850 3880"),
        "READ_STEPS": at("5c0 680 810 a90 1060", BLOCK) + at("860 8b0 a20", lanes=16),
        "READ_WARPS": at("610"),
        "MULTI_WARPS": at("730 c00 e60 e80 f10"),
        "VISIBLE_WARPS": at("ae0 bc0 ff0"),
        "ROUNDS": at("540 590 1120 1630 1890 2710 2e40 3230 3680 37c0", BLOCK),
        "MASK_WARPS": at("1170 11f0 12c0"),
        "MASK_CLEARS": at("1270"),
        "ROUND_WARPS": at("16a0 1800 18e0 2010 2030 3270"),
        "INDIRECT_WARPS": at("1770"),
        "SINGLE_WARPS": at("2040"),
        "FAST_WARPS": at("20d0 2120 2140 2150 2210 2260"),
        "SLOW_WARPS": at("20d0 2120 2140 22b0"),
        "SLOW_STEPS": at("2560 25b0 25e0 26e0"),
        "ROW_ENDS": at("2660"),
        "BIN_WARPS": at("27e0 36e0"),
        "ALLOC_WARPS": at("2c70 2de0 2fc0 30d0 3110") + at("2cb0", lanes=1),
        "ALLOC_ROUNDS": at("2ee0 2f60 3220", BLOCK) + at("2f00", lanes=1),
        "WALK_STEPS": at("3330 3620"),
        "ENQUEUE_STEPS": at("33c0"),
    },
    "coarseRaster": {
        "CTA_STARTS": at("0 a0 d0 4a0 1020 1530 1710 1790", BLOCK) + at("1730", lanes=1),
        "BIN_WARPS": at("230 260"),
        "SORT_WARPS": at(_SORT),
        "SORT_MERGES": at("1070 1410", BLOCK) + at("10f0 1190 1270 12b0 13f0", 2),
        "SORT_STEPS": at("12d0 1340 13d0"),
        "BINS": at("1710 1790 1820 18b0 1a40 1c80 1d70 93c0 97a0 99b0 9b70", BLOCK)
        + at("1730 9960", lanes=1)
        + at("18f0 19b0 1a20", lanes=16)
        + at("1a90 1b20 1bd0 9410 9690 9620", TILES)
        + at("9800 9850 9950", lanes=8),
        "ACTIVE_WARPS": at("9a20"),
        "ROUNDS": at("1e00 2e50 2e80 30a0 30c0 30d0 30d0 3230 34c0 5200 5ab0 5ca0 70e0 7c70 8060 9380", BLOCK)
        + at("5260 5ce0 5d60 5ff0 65b0 80b0 8140 8390 8930 56f0 5720 57a0", TILES)
        + at("5b20 5b50 5c60 5c80", lanes=8),
        "SCAN_WARPS": at("57f0 5850 5a70 5a90") + at("56f0 5720 57a0", -1),
        "MERGES": at("1e30 2310", BLOCK) + at("1e70 1ea0 2010 20d0", lanes=16),
        "STREAM_READS": at("23a0 2e10", BLOCK) + at("2120 2280 22f0", lanes=1),
        "MERGE_WARPS": at("2410 2470 2630"),
        "ROUND_WARPS": at("3350 3430 3500"),
        "INDIRECT_WARPS": at("33a0"),
        "CASE_A_WARPS": at("50f0 5100 5190 51d0"),
        "CASE_B_WARPS": at("3d70 4550 4580 50d0"),
        "CASE_B_ROWS": at("45b0 45e0 4600 4640 4670 4ac0 5060 50b0"),
        "CASE_B_STEPS": at("46b0 46f0 4700 4720 4760 4770 47e0"),
        "CASE_C_WARPS": at("3d70 43a0 43b0 4530"),
        "CASE_C_STEPS": at("43e0 4430 4460"),
        "ALLOC_ROUNDS": at("5e20 5f90", lanes=1),
        "EMIT_BLOCK_WARPS": at("71e0"),
        "EMIT_WARPS": at("7370"),
        "SEGMENT_WARPS": at("7c90 7d00 7eb0"),
        "LINK_WARPS": at("81c0 8310"),
        "FIRST_WARPS": at("8270"),
    },
    "fineRaster": {
        "WARP_STARTS": at(f"0 90 d0 110 210 220 920 9e0 {_DRAW}") + at("b10", lanes=1),
        "TILE_STORES": at(f"{_DRAW} bc0 11e0 12e0 3130 3170 3b60") + at("b10", lanes=1),
        "REFILLS": at("1340"),
        "ZMAX_UPDATES": at("1390"),
        "LIST_WARPS": at("16a0"),
        "SEGMENTS": at("15a0 1840 1c50 1c90 2290 22d0 2830 2870 2d10 2f10 30c0"),
        "FULL_SEGMENTS": at("2f40"),
        "TAG_WARPS": at("3210"),
        "FRAGMENT_ROUNDS": at("12e0 3130 3170 3190 31d0 32f0 3330 3390 33b0 38b0 3910 3940 3950 3b10"),
        "SHADE_ROUNDS": at("3960 39a0 39f0 3a00 3a40 3a60"),
    },
}
"""What one event runs, by kernel."""

_CLIPPING = {"CLIP_WARPS", "CLIP_STEPS", "FAN_STEPS"}  # seldom in both warps of a block; all else in both, side by side
CHAINS: dict[str, Events] = {
    "triangleSetup": {
        event: tuple(run._replace(times=1.0 if event in _CLIPPING else 0.5) for run in runs)
        for event, runs in RUNS["triangleSetup"].items()
    },
    "binRaster": {
        "CTA_STARTS": at("0 90 190 280 3e0 410 470 3960 3990"),
        "BATCHES": at("3e0 410 470 510 3830 3850 3880 3940"),
        "READ_STEPS": at("5c0 610 680 810 860 8b0 a20 a90 ae0 bc0 ff0 1060"),
        "ROUNDS": at(
            "540 590 1120 1170 11f0 12c0 1630 16a0 1800 1890 18e0 2010 2030 2710 27e0 2e40 3230 3270 3680 36e0 37c0"
        ),
        "SINGLE_ROUNDS": at("2040"),
        "FAST_ROUNDS": at("20d0 2120 2140 2150 2200 2210 2240 2260 2280"),
        "SLOW_ROUNDS": at("20d0 2120 2140 22b0"),
        "LONGEST_SLOW": at("2560 25b0 25e0 26e0"),
        "LONGEST_WALKS": at("3330 33c0 3620"),
        "ALLOC_ROUNDS": at("2c70 2cb0 2de0 2ee0 2f00 2f60 2fc0 30d0 3110 3220"),
    },
    "coarseRaster": {
        "CTA_STARTS": at(f"0 a0 d0 230 260 4a0 {_SORT} 1020 1530 1710 1730 1790"),
        "SORT_MERGES": at("1070 10f0 1190 1270 12b0 13f0 1410"),
        "SORT_STEPS": at("12d0 1340 13d0", 0.5),
        "BINS": at(
            "1710 1730 1790 1820 18b0 18f0 19b0 1a20 1a40 1c80 1d70 93c0 9410 9550 9570 9690 97a0 9800 9850 9950 9960"
            " 99b0 9a20 9b70"
        ),
        "ROUNDS": at(
            "1e00 2e50 2e80 30a0 30c0 30d0 30d0 3230 3350 3430 34c0 3500 5200 5260 57f0 5850 5a70 5a90 5ab0 5b20 5b50"
            " 5c60 5c80 5ca0 5ce0 5d60 5ff0 65b0 70e0 71e0 7c70 8060 80b0 8140 8390 8930 9380"
        ),
        "MERGES": at("1e30 1e70 1ea0 2010 20d0 2310"),
        "STREAM_READS": at("2120 2280 22f0 23a0 2410 2470 2630 2e10"),
        "CASE_A_ROUNDS": at("50f0 5100 5180 5190 51c0 51d0 51f0"),
        "WIDE_ROUNDS": at("3d70 43a0 43b0 4530"),
        "LONGEST_B": at("46b0 46f0 4700 4720 4760 4770 47e0") + at("45b0 45e0 4600 4640 5060 50b0", 0.25),
        "LONGEST_C": at("43e0 4430 4460"),
        "ALLOC_ROUNDS": at("5e20 5f90 7c90 7d00 7eb0 81c0 8270 8310"),
        "EMIT_STEPS": at("7370"),
    },
    "fineRaster": RUNS["fineRaster"]
    | {
        "SEGMENTS": at("15a0 16a0 1840 1c50 1c90 2290 22d0 2830 2870 2d10 2f10 2f40 30c0"),
        "FRAGMENT_ROUNDS": at("12e0 3130 3170 3190 31d0 3210 32f0 3330 3390 33b0 38b0 3910 3940 3950 3b10"),
        "LIST_WARPS": (),
        "TAG_WARPS": (),
        "FULL_SEGMENTS": (),
    },
}
"""What the slowest warp of an event runs, which the other warps of its block wait for."""

LANES: dict[str, dict[str, str]] = {
    "triangleSetup": {
        "WARPS": "TRIANGLE_LANES",
        "FAST_WARPS": "FAST_LANES",
        "SITE_WARPS": "SITE_LANES",
        "CLIP_WARPS": "CLIP_LANES",
        "CLIP_STEPS": "CLIP_STEP_LANES",
        "FAN_STEPS": "FAN_LANES",
        "STORE_STEPS": "STORE_LANES",
    },
    "binRaster": {
        "READ_WARPS": "READ_LANES",
        "VISIBLE_WARPS": "VISIBLE_LANES",
        "ALLOC_WARPS": "SEGMENTS",
        "ROUND_WARPS": "TRIANGLES",
        "SINGLE_WARPS": "SINGLE_LANES",
        "FAST_WARPS": "FAST_LANES",
        "SLOW_WARPS": "SLOW_LANES",
        "SLOW_STEPS": "SLOW_LANE_STEPS",
        "BIN_WARPS": "BIN_LANES",
        "MASK_WARPS": "MASK_LANES",
        "WALK_STEPS": "BOX_BINS",
        "ENQUEUE_STEPS": "EMITS",
    },
    "coarseRaster": {
        "CASE_B_STEPS": "CASE_B_LANE_STEPS",
        "CASE_B_ROWS": "CASE_B_LANE_ROWS",
        "CASE_C_STEPS": "CASE_C_LANE_STEPS",
        "EMIT_WARPS": "EMITS",
        "ACTIVE_WARPS": "ACTIVE_TILES",
    },
    "fineRaster": {
        "LIST_WARPS": "ENTRY_LANES",
        "TAG_WARPS": "TAG_LANES",
        "FULL_SEGMENTS": "FULL_LANES",
        "FRAGMENT_ROUNDS": "FRAGMENT_LANES",
        "SHADE_ROUNDS": "SHADE_LANES",
    },
}
"""The event that counts the lanes of an event's blocks; absent: as its runs say."""

PASSED = {
    "triangleSetup": {"atomic"},
    "binRaster": {"atomic", "load", "shared_atomic"},
    "coarseRaster": {"atomic", "load", "shared_atomic"},
    "fineRaster": {"atomic", "shared_atomic"},
}
"""Classes that the stage counts itself, as machine events."""
REGISTERS = {"triangleSetup": 70, "binRaster": 48, "coarseRaster": 70, "fineRaster": 56}
