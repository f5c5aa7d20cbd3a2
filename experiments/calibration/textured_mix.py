"""The instruction mixes of Ru 2016's pipelines on compute capability 9.0, written from machine code and fitted chains.

    python -m tilestamp.experiments.calibration.textured_mix LISTING PIPELINE

prints tables of ``simulator/mixes/tiled/cc9.toml`` or ``simulator/mixes/per-primitive/cc9.toml``. LISTING is
``cuobjdump -sass`` of ``experiments/cuda/textured.cu`` as nvcc 13.0.88 compiles it for sm_90 with default flags: our
words for his kernels, which leave as many instructions of each event as his, but for ``FITTED``. Chains are fitted to
the times of five scenes (``SCENES``), as the cycles of a kernel's longest warp.
"""

import sys
from pathlib import Path
from typing import Any

from tilestamp.experiments.calibration import sass
from tilestamp.experiments.calibration.cudaraster_blocks import Events, at
from tilestamp.experiments.calibration.cudaraster_mix import Price, event_prices, table

ALU_CYCLES = 4.11  # of one step of chain_alu: the machine file's latency.alu_cycles
SCENES = ["CesiumMilkTruck_near", "Duck_fit", "cow_fit", "di_fit", "flower_far"]  # that fits could see
SOURCE = "experiments/cuda/textured.cu, nvcc 13.0.88, sm_90: experiments/calibration/textured_mix.py"
COMPILED = {  # function in the listing, registers that an H200 reports of his
    "vertex_shading": ("vertex_shading", 26),
    "primitive_assembly": ("primitive_assembly", 20),
    "tile_lists": ("_Z10tile_listsILi8ELb1EEviiiiPK8TrianglePiS3_", 40),
    "tiled_raster": ("_Z12tiled_rasterILi8EEviiiiiiPK8TrianglePKiS4_PiP8Fragment", 44),
    "per_primitive_raster": ("_Z20per_primitive_rasterILb1EEviiiPK8TrianglePiP8Fragment", 44),
    "clear_depth": ("init_depth", 16),
    "fragment_shading_bilinear": ("_Z16fragment_shadingILb1EEviiPK8FragmentP2V3", 34),
    "fragment_shading_nearest": ("_Z16fragment_shadingILb0EEviiPK8FragmentP2V3", 22),
    "copy": ("copy", 16),
}
FRAME = ("vertex_shading", "primitive_assembly")
SHADING = ("fragment_shading_bilinear", "fragment_shading_nearest", "copy")
PIPELINES = {
    "tiled": (*FRAME, "tile_lists", "tiled_raster", *SHADING),
    "per-primitive": (*FRAME, "clear_depth", "per_primitive_raster", *SHADING),
}


RUNS: dict[str, Events] = {
    "vertex_shading": {"WARPS": at("0 80 2d0 310 3b0 3f0 600 8a0")},
    "primitive_assembly": {"WARPS": at("0 a0")},
    "tile_lists": {
        "WARPS": at("0 80"),
        "FRONT_WARPS": at("190 2b0"),
        "ROW_STEPS": at("380 3b0 12c0"),
        "BOX_STEPS": at("540 840 1260"),
        "EDGE_STEPS": at("a60 ce0 f60", 1 / 3),
        "APPENDS": at("11e0"),
    },
    "tiled_raster": {
        "WARPS": at("0 d0 12e0"),
        "LISTED_WARPS": at("1b0"),
        "TEST_WARPS": at("2a0 4e0 600 12a0"),
        "HIT_WARPS": at("6e0 780 7c0 860 8a0 940 980"),
        "NEARER_WARPS": at("a40 b10 b50 fd0 1010 10a0 10e0"),
    },
    "per_primitive_raster": {
        "WARPS": at("0 80"),
        "FRONT_WARPS": at("190 270"),
        "COLUMN_STEPS": at("3d0 400 1530"),
        "BOX_STEPS": at("430 590 690 1500"),
        "ATOMIC": at("770 810 850 900 940 9f0 a30 b10 b50 bf0"),
        "WRITES": at("c60 1150 1190 1230 1270 14d0"),
        "TEXTURED_WRITES": at("1320"),
    },
    "clear_depth": {"WARPS": at("0 d0")},
    "fragment_shading_bilinear": {
        "WARPS": at("0 d0"),
        "DRAWN_WARPS": at("140 1040 15f0"),
        "TEXTURED_WARPS": at("1d0 410 500 5f0 6e0 7d0 8c0 9f0 ae0 bd0 cf0 de0 ec0"),
        "ZERO_TEXELS": at("3e0 16b0 1770 17c0 17e0 1820 1cd0 1d20"),
    },
    "fragment_shading_nearest": {
        "WARPS": at("0 d0"),
        "DRAWN_WARPS": at("140 600 bb0"),
        "TEXTURED_WARPS": at("1d0 3e0 4d0 5c0"),
        "ZERO_TEXELS": at("4a0 c70 d30 d80 da0 de0 1270 12c0"),
    },
    "copy": {"WARPS": at("0 d0")},
}
"""Blocks that an event runs where no division has to take its slow path."""
LANES = {
    "WARPS": "WARP_LANES",
    "FRONT_WARPS": "FRONT_LANES",
    "ROW_STEPS": "ROW_LANES",
    "BOX_STEPS": "BOX_LANES",
    "EDGE_STEPS": "EDGE_LANES",
    "APPENDS": "APPEND_LANES",
    "LISTED_WARPS": "LISTED_LANES",
    "TEST_WARPS": "SAMPLE_TESTS",
    "HIT_WARPS": "SAMPLE_HITS",
    "NEARER_WARPS": "NEARER_LANES",
    "COLUMN_STEPS": "COLUMN_LANES",
    "ATOMIC": "ATOMIC_LANES",
    "WRITES": "WRITE_LANES",
    "TEXTURED_WRITES": "TEXTURED_LANES",
    "DRAWN_WARPS": "DRAWN_LANES",
    "TEXTURED_WARPS": "TEXTURED_LANES",
    "ZERO_TEXELS": "ZERO_LANES",
}
FITTED: dict[str, dict[str, tuple[float, float]]] = {
    "vertex_shading": {"WARPS": (6.0, 32.0)},
    "primitive_assembly": {"WARPS": (14.0, 32.0)},
    "tiled_raster": {"TEST_WARPS": (2.0, 32.0), "HIT_WARPS": (1.0, 20.0)},
    "copy": {"WARPS": (-6.0, 32.0)},
}
"""Warp instructions of an event in his machine code beyond those of ours, by the counts of an H200."""
IN_STEP = {"vertex_shading", "primitive_assembly"}  # kernels without a loop: all warps of a block load, then all store
CHAINS: dict[str, dict[str, Price]] = {
    "vertex_shading": {"BLOCKS": {"cycles": 500.0, "chain_load": 1.0}},
    "primitive_assembly": {"BLOCKS": {"cycles": 350.0, "chain_load": 2.0}},
    "tile_lists": {
        "BLOCKS": {"cycles": 1793.0},
        "LONGEST": {"cycles": 227.0},
        "LONGEST_EDGES": {"cycles": 65.0},
        "LONGEST_APPENDS": {"cycles": 91.0, "chain_atomic": 1.0},
    },
    "tiled_raster": {
        "BLOCKS": {"chain_load": 1.0},
        "ENTRIES": {"cycles": 386.0, "chain_load": 1.0},
        "LONGEST_HITS": {"cycles": 947.0},
    },
    "per_primitive_raster": {
        "BLOCKS": {"cycles": 2000.0},
        "LONGEST": {"cycles": 153.0},
        "LONGEST_HITS": {"cycles": 682.0, "chain_atomic": 1.0},
        "LONGEST_WRITES": {"cycles": 424.0},
        "LONGEST_TEXTURED": {"cycles": 232.0},
    },
    "clear_depth": {"BLOCKS": {"cycles": 90.0}},
    "fragment_shading_bilinear": {
        "BLOCKS": {"cycles": 660.0, "chain_load": 1.0},
        "DRAWN_BLOCKS": {"cycles": 3670.0, "chain_load": 1.0},  # by hand 280: they wait behind misses and write-backs
        "TEXTURED_BLOCKS": {"chain_load": 4.0},
    },
    "fragment_shading_nearest": {
        "BLOCKS": {"cycles": 660.0, "chain_load": 1.0},
        "DRAWN_BLOCKS": {"cycles": 3670.0, "chain_load": 1.0},
        "TEXTURED_BLOCKS": {"chain_load": 2.0},
    },
    "copy": {"BLOCKS": {"cycles": 170.0, "chain_load": 1.0}},
}
"""Cycles and round trips of a kernel's longest warp, by event."""


def prices(kernel: str, code: dict[int, sass.Block]) -> dict[str, Price]:
    """Prices of all events of one kernel."""
    lanes = LANES | ({"BOX_STEPS": "SAMPLE_TESTS"} if kernel == "per_primitive_raster" else {})
    out = event_prices(kernel, code, RUNS[kernel], {}, lanes, {"atomic"}, FITTED.get(kernel, {}), {})
    for event, chain in CHAINS.get(kernel, {}).items():
        waited: dict[str, Any] = {name: value for name, value in chain.items() if name != "cycles"}
        if "cycles" in chain:
            waited["chain_alu"] = chain["cycles"] / ALU_CYCLES
        about: dict[str, Any] = {"provenance": "fitted", "source": "times of his kernel", "fitted_to": "times"}
        about["fitted"] = {"chain_alu": waited.get("chain_alu", 0.0)}
        out[event] = out.get(event, {}) | waited | (about if "cycles" in chain else {})
    return out


def main(listing: Path, pipeline: str) -> str:
    """All tables of a pipeline."""
    functions = sass.read_functions(listing)
    out = []
    for kernel in PIPELINES[pipeline]:
        function, registers = COMPILED[kernel]
        code = {block[0].address: block for block in sass.basic_blocks(functions[function])}
        out.append(table(kernel, registers, SOURCE, prices(kernel, code), in_step=kernel in IN_STEP))
    return "\n".join(out)


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1]), sys.argv[2]))
