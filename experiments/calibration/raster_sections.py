"""Which event of the tile raster each basic block of its machine code belongs to, found by what the block contains."""

from collections import Counter, defaultdict

from tilestamp.experiments.calibration.sass import Block, Instruction, basic_blocks, target

Sections = dict[str, list[Block]]


def raster_sections(code: list[Instruction]) -> Sections:
    """Blocks of one ``k_raster`` by event: PIXEL, LIST, BATCH, GATHER, GRID, QUAD, BOX_TEST, BOX, HIT, Z.

    The sampling code of a kernel with four sub-tiles is there four times; its sections hold all copies.
    """
    found: Sections = defaultdict(list)
    place = "prologue"
    batch = 0  # address of the loop over batches
    for block in basic_blocks(code):
        ops = Counter(i.opcode for i in block)
        start, jump = block[0].address, target(block[-1])
        back = jump is not None and jump <= start
        if place == "prologue":
            if ops["BAR"]:
                place, batch = "batch", start
            else:
                found["LIST" if found["PIXEL"] else "PIXEL"].append(block)
        if place == "batch":
            if ops["LDS"]:
                place = "quad"
            else:
                found[_in_batch(ops, len(block))].append(block)
        if place == "quad":
            event = "QUAD" if back else _in_quad(ops, block)
            if event:
                found[event].append(block)
            place = "loops" if back else place
        elif place == "loops":
            if back:
                found["BATCH" if jump == batch else "GRID"].append(block)
            else:
                place = "end"
        if place == "end":
            found["PIXEL"].append(block)
            if ops["STG"]:
                break
    return found


def _in_batch(ops: Counter[str], size: int) -> str:
    """Filling the shared memory with grids, and the head of the loop over them."""
    if ops["LDG"]:
        return "GATHER"
    return "BATCH" if ops["BAR"] or size == 1 else "GRID"


def _in_quad(ops: Counter[str], block: Block) -> str:
    """One quad: sub-tile test, box test, edge functions, z, colour; nothing for the reciprocal of a denormal."""
    if ops["CALL"] or (len(block) <= 2 and block[-1].text.startswith("BRA")):
        return ""
    if ops["LDS"]:
        return "QUAD"
    if ops["F2I"]:
        return "Z"
    if ops["FSEL"] >= 3 or ops["MUFU"] or (ops["BSSY"] and ops["LOP3"]):
        return "HIT"
    if ops["BREAK"] or ops["FADD"] >= 4:
        return "BOX"
    if ops["BSSY"] and ops["FSETP"]:
        return "BOX_TEST"
    if ops["BSYNC"] and ops["FSETP"]:
        return "HIT"
    return "BOX_TEST" if ops["BSYNC"] and len(block) == 1 else "QUAD"
