"""Prices of programs of the ROP, and of lists of fragments, on compute capability 9.0, from our kernels' machine code.

    nvcc -arch=sm_90 -cubin -o blend.cubin experiments/cuda/blend.cu
    cuobjdump -sass blend.cubin > LISTING
    python -m tilestamp.experiments.calibration.blend_mix LISTING

prints lines of ``simulator/mixes/cudaraster/cc9.toml``: the conflict loop with a program in it is a step of the ROP, a
loop inside it a layer, and so is the loop that resolves a pixel. Nothing is fitted.
"""

import sys
from pathlib import Path

from tilestamp.experiments.calibration.mix_from_sass import ALU_CYCLES, L1_CYCLES, Price, chain, counted
from tilestamp.experiments.calibration.sass import Block, basic_blocks, read_functions, target

PROGRAMS = {  # by the name in a listing
    "4Over": "blend", "8Additive": "blend additive", "3Max": "blend max", "8Multiply": "blend multiply",
    "7Nearest": "blend nearest", "7KBuffer": "blend k-buffer", "10Stochastic": "blend stochastic",
    "6Linked": "lists linked", "5Fixed": "lists fixed",
}  # fmt: skip
RESOLVES = {"blend k-buffer": "resolve_k_buffer", "blend stochastic": "resolve_stochastic"}
LISTS = {"resolveLists": "ILb0E", "resolveLists: fixed": "ILb1E"}
WARPS = 8  # of a block, side by side
MOVE_BYTES = {"load_bytes": 3 * 128, "store_bytes": 2 * 128}  # a depth, and a fragment, of each lane's local memory


def loops(blocks: list[Block]) -> list[list[Block]]:
    """Blocks of each loop that a branch backwards closes, the longest first."""
    found = []
    for i, block in enumerate(blocks):
        to = target(block[-1]) if block and block[-1].opcode == "BRA" else None
        inside = [b for b in blocks[: i + 1] if to is not None and b and to <= b[0].address]
        detour = any(b[-1].opcode == "EXIT" for b in inside)  # beyond the kernel's end: a branch leads there and back
        if len(inside) > 0 and not detour and inside[0][0].address != inside[-1][-1].address:
            found.append(inside)
    return sorted(found, key=len, reverse=True)


def program_prices(blocks: list[Block]) -> dict[str, Price]:
    """A step of the ROP, and of a program of layers one of those."""
    outer, *inner = loops(blocks)
    within = [block for loop in inner for block in loop]
    step = [block for block in outer if block not in within]
    prices = {"ROP_STEPS": counted(step) | chain(step) | {"lanes": "ROP_LANES"}}
    if within:
        prices["LAYER_STEPS"] = counted(within) | chain(within) | {"lanes": "LAYER_LANES"}
    return prices


def list_prices(blocks: list[Block]) -> dict[str, Price]:
    """A fragment of a list (walked and blended), and a move in the sort, which waits for local memory."""
    walk, *others = loops(blocks)
    (move,) = [loop for loop in others if loop[0] in walk]
    (compose,) = [loop for loop in others if loop[0] not in walk]
    step = [block for block in walk if block not in move]
    ends = [block for block in blocks[: blocks.index(compose[-1]) + 3] if block not in walk and block not in compose]
    moves = chain(move)
    moves["chain_alu"] = float(moves["chain_alu"]) + L1_CYCLES / ALU_CYCLES
    return {
        "WARPS": counted(ends) | chain(ends, 1 / WARPS) | {"chain_load": 1 / WARPS},
        "LIST_STEPS": counted(step + compose) | {"load_bytes": 256, "store_bytes": 256, "lanes": "LIST_LANES"},
        "SORT_STEPS": counted(move) | MOVE_BYTES | {"lanes": "SORT_LANES"},
        "CHAIN_LISTS": chain(step + compose) | {"chain_load": 1},
        "CHAIN_SORTS": moves,
    }


def lines(name: str, prices: dict[str, Price]) -> list[str]:
    """A kernel's table."""
    made = [f'["{name}"]']
    for event, price in prices.items():
        said = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v:.5g}" for k, v in price.items()]
        made.append(f"{event} = {{ {', '.join(said)} }}")
    return made


def main(listing: Path) -> str:
    """All lines."""
    functions, made = read_functions(listing), []
    for mangled, name in PROGRAMS.items():
        prices = program_prices(basic_blocks(functions[f"_Z3ropI{mangled}EvPK5uint4Pji"]))
        if name in RESOLVES:
            loop = loops(basic_blocks(functions[RESOLVES[name]]))[0]
            prices["RESOLVE_LAYERS"] = counted(loop) | chain(loop)
        made += lines(f"fineRaster: {name}", prices)
    for name, mangled in LISTS.items():
        code = functions[f"_Z13resolve_lists{mangled}EvPKjPK5uint2S1_Pjii"]
        made += lines(name, list_prices(basic_blocks(code)))
    return "\n".join(made) + "\n"


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
