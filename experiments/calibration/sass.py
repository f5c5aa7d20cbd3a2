"""Machine code of compute capability 9.0: basic blocks, instruction classes, and how long one warp takes through them.

``cuobjdump -sass`` prints each instruction with its 128 bits. From Volta on, 21 of them are the compiler's schedule:
for how many cycles the warp stalls after the instruction, and which of six scoreboards it sets (its result comes after
an unknown time) or waits for. So a lone warp's time through straight code can be read off, but for the latencies of
what scoreboards guard; those are measured (``microbenchmarks.csv``), two are fitted and say so.
"""

import lzma
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

_FUNCTION = re.compile(r"\s+Function : (\S+)")
_FIRST = re.compile(r"\s+/\*([0-9a-f]{4,5})\*/\s+(.*?);\s+/\* 0x[0-9a-f]+ \*/")
_SECOND = re.compile(r"\s+/\* (0x[0-9a-f]+) \*/")
_TARGET = re.compile(r"\b(?:BRA|CALL\S*|BREAK)\b.*?(0x[0-9a-f]+)$")
_ENDS = re.compile(r"\b(BRA|EXIT|CALL|RET)\b")
_CLASSES = {  # machine event: opcodes, told from ncu's counters by execution pipe
    "fp32": "FADD FMUL FFMA",
    "mul32": "IMAD",
    "sfu": "MUFU F2I I2F POPC FLO",
    "control": "BRA EXIT BSSY BSYNC BREAK CALL RET WARPSYNC R2UR S2UR S2R LDC CS2R",
    "shared": "LDS STS",
    "shared_atomic": "ATOMS",
    "load": "LDG LDL",
    "store": "STG STL",
    "atomic": "ATOMG RED REDG",
    "barrier": "BAR",
}
CLASS_OF = {opcode: name for name, opcodes in _CLASSES.items() for opcode in opcodes.split()}
LATENCY = {  # cycles until a scoreboard is released
    "LDS": 23.0,  # measured: latency ld_shared
    "MUFU": 17.0,  # measured: latency MUFU.RSQ
    "F2I": 17.0,  # measured: latency F2I
    "I2F": 17.0,  # as F2I: the same unit
    "S2UR": 35.0,  # fitted, see mix_from_sass
    "S2R": 35.0,  # as S2UR
}
BRANCH = 13.0  # cycles, fitted: further cycles of a branch before the next instruction of the warp issues


@dataclass(frozen=True)
class Instruction:
    """One instruction and the compiler's schedule for it."""

    address: int
    text: str
    stall: int  # cycles before the next instruction
    sets: int  # scoreboard that its result releases; 7: none
    waits: int  # bit i: waits for scoreboard i

    @property
    def opcode(self) -> str:
        """Without predicate and modifiers."""
        return re.sub(r"^@!?U?P\d+\s+", "", self.text).split()[0].split(".")[0]

    @property
    def kind(self) -> str:
        """Class of the machine event table; what runs on the uniform path only takes an issue slot, as control does."""
        uniform = self.opcode.startswith("U")
        return "control" if uniform else CLASS_OF.get(self.opcode, "int32")


Block = list[Instruction]


def read_functions(path: Path) -> dict[str, list[Instruction]]:
    """Instructions of each kernel in a ``cuobjdump -sass`` listing, .xz or plain."""
    text = lzma.decompress(path.read_bytes()).decode() if path.suffix == ".xz" else path.read_text()
    functions: dict[str, list[Instruction]] = {}
    code: list[Instruction] = []
    pending: tuple[int, str] | None = None
    for line in text.splitlines():
        if match := _FUNCTION.match(line):
            code = functions.setdefault(match[1], [])
        elif match := _FIRST.match(line):
            pending = int(match[1], 16), match[2].strip()
        elif pending and (match := _SECOND.match(line)):
            high = int(match[1], 16)
            if not pending[1].startswith("NOP"):
                code.append(Instruction(*pending, (high >> 41) & 15, (high >> 46) & 7, (high >> 52) & 63))
            pending = None
    return functions


def target(instruction: Instruction) -> int | None:
    """Address that a branch goes to."""
    match = _TARGET.search(instruction.text)
    return int(match[1], 16) if match else None


def basic_blocks(code: list[Instruction]) -> list[Block]:
    """Cut a kernel at branches and at their targets."""
    targets = {target(i) for i in code}
    blocks: list[Block] = [[]]
    for instruction in code:
        if instruction.address in targets and blocks[-1]:
            blocks.append([])
        blocks[-1].append(instruction)
        if _ENDS.search(instruction.text):
            blocks.append([])
    return [block for block in blocks if block]


def classes(block: Block) -> Counter[str]:
    """Instructions by machine event."""
    return Counter(instruction.kind for instruction in block)


def cycles(block: Block, latency: dict[str, float] = LATENCY) -> float:
    """Cycles of one warp, alone, from the first instruction of a block to the one after it; loads and barriers free."""
    now = 0.0
    ready = [0.0] * 8
    for instruction in block:
        waited = [ready[bit] for bit in range(6) if instruction.waits >> bit & 1]
        now = max([now, *waited])
        if instruction.sets < 7:
            ready[instruction.sets] = now + latency.get(instruction.opcode, 0.0)
        now += max(1, instruction.stall)
        if instruction.opcode == "BRA":
            now += BRANCH
    return now
