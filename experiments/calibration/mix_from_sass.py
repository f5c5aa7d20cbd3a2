"""The instruction mix of the micropolygon back end on compute capability 9.0, written from its machine code.

    python -m tilestamp.experiments.calibration.mix_from_sass LISTING

prints the tables of the address calculation, the bucket write and the tile raster of ``simulator/mixes/micropolygon/
cc9.toml``. Everything in them is read from the code: instructions by class and section, and by the compiler's schedule
the cycles that a lone warp needs for each section. Two latencies of that schedule are not in the micro-benchmarks and
are fitted to the times of one scene, teapot_512x512_bb4 (``tilestamp.experiments.calibration.sass``: S2UR, BRANCH).
"""

import sys
from collections import Counter
from pathlib import Path
from typing import Any

from tilestamp.experiments.calibration.raster_sections import Sections, raster_sections
from tilestamp.experiments.calibration.sass import (
    LATENCY,
    Block,
    Instruction,
    basic_blocks,
    classes,
    cycles,
    read_functions,
)

ALU_CYCLES = 4.11  # of one step of chain_alu: the machine file's latency.alu_cycles
SHARED_CYCLES = LATENCY["LDS"]
WARP = 32
QUADS, VERTICES = 9, 16  # a grid
ENTRIES_A_SECTOR = 8  # indices of grids, 4 bytes each
L1_CYCLES = 32.04  # the machine file's latency.l1_cycles
RASTER = "_Z8k_rasterILi{tile}ELi{spp}ELi{mode}EEvPK6float4PKjS4_S4_iiiPjPfPy"
ADDRESS = "_Z6k_addrILi{slots}EEvPK6float4iiiiPjS3_"
WRITE = "_Z7k_writeILi{slots}EEvPK6float4iiiiPKjS4_Pj"
REGISTERS = {  # a thread, by samples a pixel and box tests: ncu; without box tests it was asked for tile 8 only
    (1, True): {4: 49, 8: 36, 16: 36, 32: 37},
    (1, False): {4: 49, 8: 32, 16: 32, 32: 37},
    (4, True): {4: 58, 8: 47, 16: 47, 32: 56},
    (4, False): {4: 58, 8: 48, 16: 48, 32: 56},
}
Price = dict[str, float | str]


def chain(blocks: list[Block], share: float = 1.0) -> Price:
    """What a unit waits for on its way through some blocks: arithmetic steps, and shared memory by itself."""
    shared = sum(any(i.opcode == "LDS" for i in block) for block in blocks)
    steps = (sum(map(cycles, blocks)) - shared * SHARED_CYCLES) / ALU_CYCLES
    return {"chain_alu": steps * share, **({"chain_shared": shared * share} if shared else {})}


def counted(blocks: list[Block], share: float = 1.0) -> Price:
    """Warp instructions by class."""
    total = sum((classes(block) for block in blocks), Counter())
    return {name: count * share for name, count in sorted(total.items())}


def _with(price: dict[str, Any], **more: float | str) -> Price:
    return price | more


def raster_prices(sections: Sections, tile: int, spp: int) -> dict[str, Price]:
    """Prices of the events of the tile raster in one of its compiled variants."""
    s = sections
    warps = max(1, tile * tile // WARP)
    alone, copies = 1 / warps, 1 / spp
    threads: Price = {"lanes": float(min(WARP, tile * tile))}
    part = {name: chain(s[name], copies * alone) for name in ("BOX", "HIT", "Z")}
    grids = chain(s["QUAD"], QUADS) | {}
    grids["chain_alu"] = float(grids["chain_alu"]) + float(chain(s["GRID"])["chain_alu"])
    quad: Counter[str] = Counter(counted(s["QUAD"]))  # counts that may be fractions
    quad += Counter(counted(s["GRID"], 1 / QUADS))
    prices: dict[str, Price] = {
        "PIXEL_WARPS": counted(s["PIXEL"]) | chain(s["PIXEL"], alone) | {"chain_load": alone, "lanes": "PIXEL_LANES"},
        "LIST_WARPS": counted(s["LIST"]) | chain(s["LIST"], alone) | {"chain_load": alone} | threads,
        "BATCHES": _batch(s["BATCH"] + s["GATHER"], tile),
        "BATCH_WARPS": counted(s["BATCH"]) | threads,
        "GATHER_WARPS": counted(s["GATHER"]) | {"lanes": "GATHER_LANES"},
        "GRIDS": grids,
        "QUAD_WARPS": _with(dict(quad), lanes="QUAD_LANES"),
        "BOX_WARPS": counted(s["BOX"], copies) | part["BOX"] | {"lanes": "BOX_LANES"},
        "HIT_WARPS": counted(s["HIT"], copies) | part["HIT"] | {"lanes": "HIT_LANES"},
        "Z_WARPS": counted(s["Z"], copies) | part["Z"] | {"lanes": "Z_LANES"},
    }
    if s["BOX_TEST"]:
        prices["SUBTILE_PASS"] = chain(s["BOX_TEST"], copies)
        prices["BOX_TEST_WARPS"] = counted(s["BOX_TEST"], copies) | {"lanes": "BOX_TEST_LANES"}
    return prices


def _batch(blocks: list[Block], tile: int) -> Price:
    """Round trips of one batch: its entries of the list, in L1 where a sector of eight came before; its grids."""
    fetched = min(1.0, tile * tile / VERTICES / ENTRIES_A_SECTOR)
    price = chain(blocks)
    price["chain_alu"] = float(price["chain_alu"]) + (1.0 - fetched) * L1_CYCLES / ALU_CYCLES
    return price | {"chain_load": 1.0 + fetched, "chain_barrier": 2.0}


def patch_prices(code: list[Instruction], event: str, chains: Price) -> dict[str, Price]:
    """Prices of a kernel with a thread a patch.

    Parameters
    ----------
    code : list of Instruction
    event : str
        What the code that is branched around does: an atomic, or a write to a list.
    chains : dict
        Round trips of one warp, in eighths: the eight of a block run side by side.
    """
    bodies: list[Block] = []
    rest: list[Block] = []
    for block in basic_blocks(code):
        ops = Counter(i.opcode for i in block)
        if ops["CALL"] or (len(block) <= 2 and block[-1].text.startswith("BRA")):
            continue  # reciprocal of a denormal
        body = ops["ATOMG"] or (len(block) <= 6 and ops["LDG"])
        (bodies if body else rest).append(block)
        if block[-1].text == "EXIT":
            break
    patch = counted(rest) | chain(rest, 1 / 8) | {name: float(count) / 8 for name, count in chains.items()}
    share = 1 / len(bodies) if event == "ATOMIC" else 1 / 9 if event == "WRITE_WARPS" else 1.0
    slot = counted(bodies, share) | {"lanes": "SLOT_LANES" if event == "ATOMIC" else event.replace("WARPS", "LANES")}
    slot.pop("atomic", None)  # the event ATOMIC passes through
    prices: dict[str, Price] = {"PATCH_WARPS": patch | {"lanes": "PATCH_LANES"}, event: slot}
    if event == "ATOMIC":  # lanes that skip a body wait at its end, in an instruction of their own
        prices["DIVERGENT_WARPS"] = {"control": 1.0, "lanes": 0.0}
    return prices


def table(name: str, registers: int, prices: dict[str, Price]) -> str:
    """One kernel as TOML, an event a line."""
    lines = [
        f'["{name}"]',
        f"registers = {registers}",
        'provenance = "disassembled"',
        'source = "micropolygon_sm90.sass"',
    ]
    for event, price in prices.items():
        entries = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v:.4g}" for k, v in price.items()]
        lines.append(f"{event} = {{ {', '.join(entries)} }}")
    return "\n".join(lines) + "\n"


def main(listing: Path) -> str:
    """All tables."""
    functions = read_functions(listing)
    out = []
    for (spp, box), registers in REGISTERS.items():
        for tile in (4, 8, 16, 32):
            code = functions[RASTER.format(tile=tile, spp=spp, mode=int(not box))]
            name = f"tile_raster: tile {tile} spp {spp}" + ("" if box else " no box")
            out.append(table(name, registers[tile], raster_prices(raster_sections(code), tile, spp)))
    for slots in (2, 3):
        add = patch_prices(functions[ADDRESS.format(slots=slots)], "ATOMIC", {"chain_load": 1, "chain_atomic": 1})
        last = "LAST_WRITE_WARPS" if slots == 2 else "WRITE_WARPS"
        write = patch_prices(functions[WRITE.format(slots=slots)], last, {"chain_load": 2})
        out.append(table(f"address_calculation: {slots}x{slots} slots", 19 if slots == 2 else 32, add))
        out.append(table(f"bucket_write: {slots}x{slots} slots", 22 if slots == 2 else 32, write))
    return "\n".join(out)


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
