"""Prices of the rasters of stochastic and nonlinear on compute capability 9.0, written from our kernels' machine code.

    nvcc -arch=sm_90 -cubin -o stochastic.cubin experiments/cuda/stochastic.cu
    cuobjdump -sass stochastic.cubin > LISTING
    python -m tilestamp.experiments.calibration.stochastic_mix LISTING

prints tables of ``simulator/mixes/stochastic/cc9.toml`` and ``simulator/mixes/nonlinear/cc9.toml``. Each event is some
basic blocks of the listing, as nvcc 13.0.88 makes them. Nothing is fitted; slow paths of roots and divisions, and
samples on edges, are left out. A block's chain is that of one of its two warps (tiles of 8).
"""

import sys
from pathlib import Path

from tilestamp.experiments.calibration import cudaraster_mix, sass
from tilestamp.experiments.calibration.cudaraster_blocks import Events, at

REGISTERS = {"sample_raster": 56, "ray_raster": 32}
TABLES = {"sample_raster": "sample_raster", "ray_raster": '"sample_raster: rays"'}
SOURCE = "experiments/cuda/stochastic.cu, nvcc 13.0.88, sm_90: experiments/calibration/stochastic_mix.py"
UNROLLED = 0.25  # samples a pass
SIDE_BY_SIDE = 0.5  # of a warp's chain, two in a block


RUNS: dict[str, Events] = {
    "sample_raster": {
        "WARPS": at("0 390 440 ca0 1730 1770 17e0 1c10 1c50"),
        "SAMPLES": at("4e0 1840", UNROLLED),
        "ENTRY_WARPS": at("d00 d70 1720"),
        "TEST_WARPS": at("df0 16d0"),
        "HIT_WARPS": at("1120 1150 1480 1570 1670"),
    },
    "ray_raster": {
        "WARPS": at("0 3a0 440 22c0 2320 28f0 2910 2990 2dc0 2e00"),
        "SAMPLES": at("1cb0 1de0 1ef0 1fc0 2000 2050 2140 2160") + at("29f0", UNROLLED),
        "ENTRY_WARPS": at("2360 23d0 28e0"),
        "TEST_WARPS": at("2430 2890"),
        "HIT_WARPS": at("25b0 2600 2720 2840"),
    },
}
LANES = {"WARPS": "WARP_LANES", "TEST_WARPS": "SAMPLE_TESTS", "HIT_WARPS": "SAMPLE_HITS"}


def main(listing: Path) -> str:
    """Both tables."""
    functions, made = sass.read_functions(listing), []
    for kernel, runs in RUNS.items():
        code = {block[0].address: block for block in sass.basic_blocks(functions[kernel]) if block}
        chains = {event: runs[event] for event in ("WARPS", "SAMPLES", "HIT_WARPS")}
        chains |= {"ENTRIES": runs["ENTRY_WARPS"], "MASKED_TESTS": runs["TEST_WARPS"]}
        halves = dict.fromkeys(("WARPS", "SAMPLES", "HIT_WARPS"), SIDE_BY_SIDE)
        prices = cudaraster_mix.event_prices(kernel, code, runs, chains, LANES, set(), {}, halves)
        prices["WARPS"]["chain_load"] = SIDE_BY_SIDE  # the ends of the list
        prices["ENTRIES"]["chain_load"] = 2  # the entry, then its triangle
        fetches = UNROLLED if kernel == "sample_raster" else 1.0  # waits for a sample's place; then its grey
        prices["SAMPLES"]["chain_load"] = SIDE_BY_SIDE * (fetches + UNROLLED)
        made.append(cudaraster_mix.table(TABLES[kernel], REGISTERS[kernel], SOURCE, prices))
    return "\n".join(made)


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
