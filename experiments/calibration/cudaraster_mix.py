"""The instruction mix of CudaRaster on compute capability 9.0, written from its machine code and a few fitted numbers.

    python -m tilestamp.experiments.calibration.cudaraster_mix LISTING > simulator/mixes/cudaraster/cc9.toml

LISTING is what ``cuobjdump -sass`` prints (see ``cudaraster_blocks``). Instructions of each event by class, and by the
compiler's schedule the cycles that a lone warp needs for them, are read from the code. ``FITTED`` holds what the blocks
do not say: it was fitted by ``tilestamp.experiments.silicon.leave_one_out``, which also shows how far the fit carries.
"""

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

from tilestamp.experiments.calibration import sass
from tilestamp.experiments.calibration.cudaraster_blocks import CHAINS, LANES, PASSED, REGISTERS, RUNS, Events, Run
from tilestamp.experiments.calibration.sass import Block

ALU_CYCLES = 4.11  # of one step of chain_alu: the machine file's latency.alu_cycles
BARRIER_CYCLES = 24.0  # a barrier of 16 warps takes longer than the machine file's, of 4 (microbenchmarks.csv)
LATENCY = sass.LATENCY | {  # microbenchmarks.csv, group latency
    "POPC": 17.0,
    "FLO": 17.0,
    "VOTE": 17.0,  # VOTE.BALLOT
    "MATCH": 369.0,  # MATCH.ANY
    "ATOMS": 36.0,  # atom_shared_add
    "LDL": 48.0,  # ld_ca_16KiB
}
IN_STEP = {"triangleSetup"}  # no loop: all warps of a block load, and then all store
LONG = 1000.0  # cycles: how often a path waits for a load shows when a load takes this long
OWN_LOADS = {  # loads that the stages do not count
    ("binRaster", "INDIRECT_WARPS"): 1.0,
    ("coarseRaster", "INDIRECT_WARPS"): 1.0,
    ("coarseRaster", "BINS"): 2.0,
    ("coarseRaster", "STREAM_READS"): 1.0,
}
FITTED: dict[str, dict[str, tuple[float, float]]] = {
    "triangleSetup": {"CLIP_WARPS": (372.7, 0.0), "SITE_WARPS": (4.77, 0.0), "FAST_WARPS": (2.09, 0.0)},
    "binRaster": {"SLOW_WARPS": (15.52, 0.0), "ROW_ENDS": (7.45, 0.0), "WALK_STEPS": (1.68, 0.0)},
    "coarseRaster": {"ROUNDS": (264.7, 0.0), "CASE_C_STEPS": (7.8, 7.0)},
    "fineRaster": {
        "WARP_STARTS": (536.75, 19.6),
        "FRAGMENT_ROUNDS": (4.98, 26.4),
        "PARTIAL_SEGMENTS": (98.16, 18.4),
    },
}
"""Warp instructions of an event beyond those of its blocks, and the lanes that run them."""
CHAIN_FACTOR: dict[str, dict[str, float]] = {
    "triangleSetup": {"CLIP_WARPS": 1.3, "CLIP_STEPS": 1.3, "FAN_STEPS": 1.3},
    "binRaster": {"LONGEST_SLOW": 1.6, "LONGEST_WALKS": 1.6},
    "coarseRaster": {"": 1.03, "LONGEST_B": 0.6},
}
"""By kernel and event ("": all others): how much longer its slowest warp takes than alone."""
COPY = {  # as published: instructions that copy the parameters, and the wait for an SM to store 32 bytes a clock
    "triangleSetup": {"WARPS": {"store": 83.0, "control": 71.0}},
    "binRaster": {
        "CTA_STARTS": {"store": 16 * 83.0, "control": 16 * 99.0, "chain_alu": 2585.0},
        "ROUNDS": {"control": -84.0},
    },
}
COPY_SOURCE = "derived: the listing of the kernel as published, beside the one without the copy"
Price = dict[str, Any]


def code_of(listing: Path, kernel: str) -> dict[int, Block]:
    """Basic blocks of one kernel by address."""
    name = f"{kernel}Kernel"
    functions = sass.read_functions(listing)
    code = functions[next(f for f in functions if name in f)]
    return {block[0].address: block for block in sass.basic_blocks(code)}


def instructions(runs: tuple[Run, ...], code: dict[int, Block], passed: set[str]) -> tuple[dict[str, float], float]:
    """Warp instructions by class of one event, and the lanes that run them on average."""
    total: dict[str, float] = defaultdict(int)
    lanes = 0.0
    for run in runs:
        for address in run.addresses:
            for name, count in sass.classes(code[address]).items():
                if name not in passed:
                    total[name] += count * run.times  # fractions of a warp
                    lanes += count * run.times * run.lanes
    return total, lanes / max(sum(total.values()), 1e-9)


def chain(runs: tuple[Run, ...], code: dict[int, Block], factor: float) -> Price:
    """What the slowest warp waits for: arithmetic, and by themselves loads, atomics and barriers."""
    price: dict[str, float] = defaultdict(int)
    for share in {min(run.times, 1.0) for run in runs if run.times > 0}:
        here = [a for run in runs if min(run.times, 1.0) == share for a in run.addresses]
        path = [i for address in sorted(here) for i in code[address]]
        barriers = sum(i.opcode == "BAR" for i in path)
        alone = sass.cycles(path, LATENCY)
        price["chain_alu"] += share * (alone * factor + BARRIER_CYCLES * barriers) / ALU_CYCLES
        price["chain_barrier"] += share * barriers
        for name, opcode in (("chain_load", "LDG"), ("chain_atomic", "ATOMG")):
            waited = sass.cycles(path, LATENCY | {opcode: LONG}) - alone
            price[name] += share * round(waited / LONG)
    return {name: value for name, value in price.items() if value}


def event_prices(
    kernel: str,
    code: dict[int, Block],
    runs: Events,
    chains: Events,
    named: dict[str, str],
    passed: set[str],
    fitted: dict[str, tuple[float, float]],
    factors: dict[str, float],
) -> dict[str, Price]:
    """Prices of all events of one kernel.

    Parameters
    ----------
    kernel : str
        Also the name of the cells that its numbers were fitted to, in the table ``fits`` of the file.
    code : dict
        Basic blocks by address.
    runs, chains : dict
        What an event runs, and what its slowest warp waits for.
    named : dict
        The event that counts the lanes of an event.
    passed : set of str
        Classes that the stage counts itself.
    fitted, factors : dict
        Further instructions with their lanes; factors of chains.
    """
    out: dict[str, Price] = {}
    for event in runs | chains | fitted:
        total, lanes = instructions(runs.get(event, ()), code, passed)
        extra, active = fitted.get(event, (0.0, 32.0))
        if extra:
            lanes = (lanes * sum(total.values()) + active * extra) / (sum(total.values()) + extra)
            total["int32"] += extra
        price: Price = {name: count for name, count in sorted(total.items()) if count}
        if event in chains:
            price |= chain(chains[event], code, factors.get(event, factors.get("", 1.0)))
        if total:
            price["lanes"] = named.get(event) or round(lanes, 2)
        if extra:
            price |= {"provenance": "fitted", "source": f"{extra:.4g} of int32, experiments.silicon.leave_one_out"}
            price |= {"fitted": {"int32": extra}, "fitted_to": kernel}
        out[event] = price
    return out


def prices(kernel: str, code: dict[int, Block]) -> dict[str, Price]:
    """Prices of all events of one kernel."""
    fitted = FITTED.get(kernel, {})
    out = event_prices(
        kernel, code, RUNS[kernel], CHAINS[kernel], LANES[kernel], PASSED[kernel], fitted, CHAIN_FACTOR.get(kernel, {})
    )
    for (of, event), loads in OWN_LOADS.items():
        if of == kernel:
            out[event]["load"] = out[event].get("load", 0.0) + loads
    if kernel == "fineRaster":  # the coverage table: each value from the one before
        out["WARP_STARTS"]["chain_alu"] += fitted.get("WARP_STARTS", (0.0, 0.0))[0]
    return out


def table(kernel: str, registers: int, source: str, found: dict[str, Price], *, in_step: bool = False) -> str:
    """One kernel as TOML, an event a line; ``in_step``: all its warps load, and then all store."""
    lines = [f"[{kernel}]", f"registers = {registers}", *["in_step = true"] * in_step]
    lines += ['provenance = "disassembled"', f'source = "{source}"']
    for event, price in found.items():
        entries = [f"{name} = {_text(value)}" for name, value in price.items()]
        lines.append(f"{event} = {{ {', '.join(entries)} }}")
    return "\n".join(lines) + "\n"


def _text(value: str | float | dict[str, float]) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{name} = {_text(part)}' for name, part in value.items())} }}"
    return f'"{value}"' if isinstance(value, str) else f"{value:.5g}"


def main(listing: Path) -> str:
    """All tables."""
    source = "RasterImpl.cu of nvdiffrast, nvcc 13.0.88, sm_90: experiments/calibration/cudaraster_blocks.py"
    found = {kernel: prices(kernel, code_of(listing, kernel)) for kernel in RUNS}
    out = [table(kernel, REGISTERS[kernel], source, found[kernel], in_step=kernel in IN_STEP) for kernel in RUNS]
    for kernel, registers in (("triangleSetup", 70), ("binRaster", 67)):
        copied = with_copy(kernel, found[kernel])
        out.append(table(f'"{kernel}: as published"', registers, source, copied, in_step=kernel in IN_STEP))
    return "\n".join(out)


def with_copy(kernel: str, found: dict[str, Price]) -> dict[str, Price]:
    """Prices of a kernel that copies its parameters."""
    out = {event: dict(price) for event, price in found.items()}
    for event, extra in COPY[kernel].items():
        for name, count in extra.items():
            out[event][name] = out[event].get(name, 0.0) + count
        out[event] |= {"provenance": "derived", "source": COPY_SOURCE}
    return out


if __name__ == "__main__":
    sys.stdout.write(main(Path(sys.argv[1])))
