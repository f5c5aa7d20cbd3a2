"""The instruction mixes of motion blur and defocus on compute capability 9.0, written from our kernels' machine code.

    nvcc -arch=sm_90 -cubin -o motion.cubin experiments/cuda/motion.cu
    cuobjdump -sass motion.cubin > LISTING
    python -m tilestamp.experiments.calibration.motion_mix LISTING interval > simulator/mixes/interval/cc9.toml

and ``interleaved`` likewise. Each event is some basic blocks of the listing, as nvcc 13.0.88 makes them. Nothing is
fitted; the ends of a tile's rows, a few instructions in 16 set-ups, are left out. A warp is a unit of work: what it
waits for is what one warp, alone, takes through the blocks.
"""

import sys
from pathlib import Path

from tilestamp.experiments.calibration import cudaraster_mix, sass
from tilestamp.experiments.calibration.cudaraster_blocks import Events, at

REGISTERS = {"interval": 72, "interleaved": 112}
SOURCE = "experiments/cuda/motion.cu, nvcc 13.0.88, sm_90: experiments/calibration/motion_mix.py"


RUNS: dict[str, Events] = {
    "interval": {
        "WARPS": at("1a0 230 260 1bb0 1ca0") + at("1be0", lanes=1),
        "BOX_WARPS": at("600 b80 1b60"),
        "TEST_WARPS": at("e60 1b10"),
        "HIT_WARPS": at("18a0"),
    },
    "interleaved": {
        "WARPS": at("1d0 240 1970 1a60") + at("19a0", lanes=1),
        "BOX_WARPS": at("660 a80 1880"),
        "TEST_WARPS": at("1110 1830"),
        "HIT_WARPS": at("1570"),
    },
}
LANES = {"BOX_WARPS": "BOXES", "TEST_WARPS": "SAMPLE_TESTS", "HIT_WARPS": "ATOMIC_LANES"}


def main(listing: Path, kernel: str) -> str:
    """One kernel's table."""
    code = {block[0].address: block for block in sass.basic_blocks(sass.read_functions(listing)[kernel])}
    prices = cudaraster_mix.event_prices(kernel, code, RUNS[kernel], RUNS[kernel], LANES, set(), {}, {})
    prices["WARPS"]["chain_load"] = 1  # the polygons: interval's first box waits for them, a block further on
    return cudaraster_mix.table(kernel, REGISTERS[kernel], SOURCE, prices)


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1]), sys.argv[2]))
