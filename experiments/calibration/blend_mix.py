"""Prices of programs of the ROP on compute capability 9.0, from our kernels' machine code.

    nvcc -arch=sm_90 -cubin -o blend.cubin experiments/cuda/blend.cu
    cuobjdump -sass blend.cubin > LISTING
    python -m tilestamp.experiments.calibration.blend_mix LISTING

prints lines of ``simulator/mixes/cudaraster/cc9.toml``: the conflict loop with a program in it is a step of the ROP, a
loop inside it a layer, and so is the loop that resolves a pixel. Nothing is fitted.
"""

import sys
from pathlib import Path

from tilestamp.experiments.calibration.mix_from_sass import Price, chain, counted
from tilestamp.experiments.calibration.sass import Block, basic_blocks, read_functions, target

PROGRAMS = {  # by the name in a listing
    "4Over": "", "8Additive": " additive", "3Max": " max", "8Multiply": " multiply", "7Nearest": " nearest",
    "7KBuffer": " k-buffer", "10Stochastic": " stochastic",
}  # fmt: skip
RESOLVES = {" k-buffer": "resolve_k_buffer", " stochastic": "resolve_stochastic"}


def loops(blocks: list[Block]) -> list[list[Block]]:
    """Blocks of each loop that a branch backwards closes, the longest first."""
    found = []
    for i, block in enumerate(blocks):
        to = target(block[-1]) if block and block[-1].opcode == "BRA" else None
        inside = [b for b in blocks[: i + 1] if to is not None and b and to <= b[0].address]
        if len(inside) > 0 and not _is_detour(inside) and inside[0][0].address != inside[-1][-1].address:
            found.append(inside)
    return sorted(found, key=len, reverse=True)


def _is_detour(blocks: list[Block]) -> bool:
    """Whether it starts at or after the kernel's end: code that a branch leads to and comes back from."""
    return any(b[-1].opcode == "EXIT" for b in blocks)


def program_prices(blocks: list[Block]) -> dict[str, Price]:
    """A step of the ROP, and of a program of layers one of those."""
    outer, *inner = loops(blocks)
    within = [block for loop in inner for block in loop]
    step = [block for block in outer if block not in within]
    prices = {"ROP_STEPS": counted(step) | chain(step) | {"lanes": "ROP_LANES"}}
    if within:
        prices["LAYER_STEPS"] = counted(within) | chain(within) | {"lanes": "LAYER_LANES"}
    return prices


def main(listing: Path) -> str:
    """All lines."""
    functions, lines = read_functions(listing), []
    for mangled, name in PROGRAMS.items():
        prices = program_prices(basic_blocks(functions[f"_Z3ropI{mangled}EvPK5uint4Pji"]))
        if name in RESOLVES:
            loop = loops(basic_blocks(functions[RESOLVES[name]]))[0]
            prices["RESOLVE_LAYERS"] = counted(loop) | chain(loop)
        lines.append(f'["fineRaster: blend{name}"]')
        for event, price in prices.items():
            said = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v:.5g}" for k, v in price.items()]
            lines.append(f"{event} = {{ {', '.join(said)} }}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
