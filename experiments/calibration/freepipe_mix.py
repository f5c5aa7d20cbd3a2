"""The instruction mix of FreePipe on compute capability 9.0, written from its machine code and a few fitted numbers.

    python -m tilestamp.experiments.calibration.freepipe_mix LISTING > simulator/mixes/freepipe/cc9.toml

LISTING is ``cuobjdump -sass`` of the two kernels of shared/silicon/src/freepipe.cu, as nvcc 13.0.88 compiles it for
sm_90 with default flags. The inner loop is unrolled four times, behind a remainder of up to three pixels. The kernel
holds the scan twice, for triangles that need no clipping and for those that do; the first stands for both here.
"""

import sys
from pathlib import Path

from tilestamp.experiments.calibration import cudaraster_mix, sass
from tilestamp.experiments.calibration.cudaraster_blocks import Events, at
from tilestamp.experiments.calibration.cudaraster_mix import Price
from tilestamp.experiments.calibration.sass import Block

REGISTERS = 58
FUNCTIONS = {"freepipe": "_Z10k_freepipeILi0EEv6FPArgs", "freepipe_early": "_Z10k_freepipeILi1EEv6FPArgs"}
WARPS = 8  # of a block: they begin side by side


_TURN = {"freepipe": "13c0 15b0 16b0 17b0 18b0", "freepipe_early": "1590 17e0 1920 1a60 1ba0"}
_REST = {"freepipe": "f70 1090 10d0 1200 1240 1360", "freepipe_early": "f90 1100 1140 12c0 1300 1470"}
RUNS: dict[str, Events] = {
    "freepipe": {
        "WARPS": at("0 90 1c0"),
        "SETUP_STEPS": at("230 2c0 300 490 4d0 610 650 780"),
        "BOX_STEPS": at("930 c20 c60"),
        "ROW_STEPS": at("e60 1390 1930"),
        "WARP_STEPS": at(_TURN["freepipe"], 0.25),
        "REST_STEPS": at(_REST["freepipe"], 1 / 3) + at(_TURN["freepipe"], -0.25),
        "ATOMIC": at("1500 15f0 16f0 1800", 0.25),
        "CLIP_WARPS": at("19a0 19f0 1a30 1a70 1ab0 1af0 1b30 1d50 1f90 21d0"),
    },
    "freepipe_early": {
        "WARPS": at("0 90 1c0"),
        "SETUP_STEPS": at("230 2d0 310 4a0 4e0 620 660 790"),
        "BOX_STEPS": at("940 c10 c50"),
        "ROW_STEPS": at("ea0 14a0 14d0 1c40"),
        "WARP_STEPS": at(_TURN["freepipe_early"], 0.25),
        "REST_STEPS": at(_REST["freepipe_early"], 1 / 3) + at(_TURN["freepipe_early"], -0.25),
        "READS": at("16f0 1820 1960 1ab0", 0.25),
        "ATOMIC": at("1770 18a0 19e0 1b30", 0.25),
        "CLIP_WARPS": at("1cf0 1d40 1d80 1dc0 1e00 1e40 1e80"),
    },
}
CHAINS: dict[str, Events] = {
    "freepipe": {
        "CHAIN_ROWS": at("e60 1390 1930"),
        "CHAIN_STEPS": at(_TURN["freepipe"], 0.25),
        "CHAIN_HITS": at("1500 15f0 16f0 1800", 0.25),
    },
    "freepipe_early": {
        "CHAIN_ROWS": at("ea0 14a0 14d0 1c40"),
        "CHAIN_STEPS": at(_TURN["freepipe_early"], 0.25),
        "CHAIN_HITS": at("16f0 1820 1960 1ab0 1770 18a0 19e0 1b30", 0.25),
    },
}
_BEGINS = {"WARPS": 1 / WARPS, "SETUP_STEPS": 1 / WARPS, "BOX_STEPS": 1 / WARPS}
LANES = {
    "WARPS": "LANES_IN",
    "SETUP_STEPS": "SETUP_LANES",
    "BOX_STEPS": "BOX_LANES",
    "ROW_STEPS": "ROW_LANES",
    "WARP_STEPS": "SAMPLE_TESTS",
    "READS": "SAMPLE_HITS",
    "ATOMIC": "ATOMIC_LANES",
    "CLIP_WARPS": "CLIP_LANES",
}
FITTED: dict[str, dict[str, tuple[float, float]]] = {
    "freepipe": {"ROW_STEPS": (8.2, 1.0)},
    "freepipe_early": {"ROW_STEPS": (10.2, 1.0)},
}
DERIVED = {  # lanes that skip a body wait at its end in an instruction of their own; the second scan has shorter bodies
    "freepipe": {"ATOMIC": 1.0, "CLIP_HITS": -5.0},
    "freepipe_early": {"READS": 1.0, "ATOMIC": 1.0, "CLIP_HITS": -3.0},
}
"""Warp instructions of an event beyond those of its blocks, and the lanes that run them."""
CHAIN_FACTOR: dict[str, dict[str, float]] = {"freepipe": {"": 1.05}, "freepipe_early": {"": 1.3}}
QUEUED = {"freepipe": 0.3, "freepipe_early": 0.8}
"""Fitted to times: steps of chain_alu that a block's warps wait for each atomic request in front of them."""


def code_of(listing: Path, kernel: str) -> dict[int, Block]:
    """Basic blocks of one kernel by address."""
    return {block[0].address: block for block in sass.basic_blocks(sass.read_functions(listing)[FUNCTIONS[kernel]])}


def prices(kernel: str, code: dict[int, Block]) -> dict[str, Price]:
    """Prices of all events of one kernel."""
    begins = {e: tuple(r._replace(times=_BEGINS[e]) for r in RUNS[kernel][e]) for e in _BEGINS}
    fitted, factors = FITTED.get(kernel, {}), CHAIN_FACTOR.get(kernel, {})
    out = cudaraster_mix.event_prices(
        kernel, code, RUNS[kernel], CHAINS[kernel] | begins, LANES, {"atomic"}, fitted, factors
    )
    for event, count in DERIVED[kernel].items():
        price = out.setdefault(event, {"lanes": 1.0})
        price["control"] = price.get("control", 0.0) + count
    about = {"provenance": "fitted", "source": "times of freepipe.csv: the SM's own requests in front"}
    out["ATOMIC_REQUESTS"] = {"chain_alu": QUEUED[kernel]} | about | {"fitted_to": kernel}
    return out


def main(listing: Path) -> str:
    """Both tables."""
    source = "shared/silicon/src/freepipe.cu, nvcc 13.0.88, sm_90: experiments/calibration/freepipe_mix.py"
    return "\n".join(
        cudaraster_mix.table(kernel, REGISTERS, source, prices(kernel, code_of(listing, kernel))) for kernel in RUNS
    )


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
