"""One-pass compaction: all blocks must be resident at once (Zhang 2025, stage 3).

A cooperative launch synchronises its whole grid, so a grid that the machine cannot hold does not start: "currently we
cannot process model have more than 10k". The limit is the machine's, not the method's; three plain launches in place
of the two grid synchronisations have none.
"""

from functools import partial

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.occupancy import residency
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.zhang2025.primitive_compaction import BLOCK, REGISTERS, SLOTS_A_TRIANGLE

QUESTION = "How many triangles can a compaction take whose blocks must all be resident?"
MACHINES = ("ga104", "rtx3080", "h200")  # cooperative launches need compute capability 6.0
STATED = 10_000  # triangles: "more than 10k"
REGISTER_COUNTS = (24, 32, 40, 48, 64, 96, 128)  # a thread
ENDS = (1000, 1_000_000)  # triangles


def fits(machine: Machine, triangles: int, registers: int = REGISTERS) -> bool:
    """Whether all blocks of the launch are resident at once."""
    blocks = -(-SLOTS_A_TRIANGLE * triangles // BLOCK)
    return blocks <= machine.sm.count * residency(machine, BLOCK, registers, 0).blocks


def boundary(machine: Machine, registers: int = REGISTERS) -> tuple[float | None, float | None]:
    """Triangles that can be drawn, and triangles that cannot."""
    return bisect(lambda triangles: not fits(machine, int(triangles), registers), *ENDS, scale="integer")


def run(progress: Progress) -> Result:
    """Ask every machine that can launch it."""
    progress("stability/resident_blocks: machines")
    rows = [
        {"machine": name, "registers": registers, "triangles": boundary(load_machine(name), registers)[0]}
        for name in MACHINES
        for registers in REGISTER_COUNTS
    ]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(name) for name in MACHINES]
    notes = [f"Published: no more than {STATED} triangles on a GPU that is not named."]
    figures = [Figure("machines", partial(
        lines, table, x="registers", y="triangles", by="machine", title="Triangles that a one-pass compaction can take",
        x_label=f"registers a thread (the source: {REGISTERS})", y_label="triangles",
    ))]  # fmt: skip
    return atlas_result(
        "stability/resident_blocks", "Resident blocks of a one-pass compaction", boundaries, figures, notes,
        {"machines": table},
    )  # fmt: skip


def _boundary(name: str) -> Boundary:
    machine = load_machine(name)
    wrong = "the launch is refused: nothing is drawn"
    cure = "three launches in place of two grid synchronisations"
    cost = f"{2 * machine.launch.stream_us:.3g} us for two more launches in a stream"
    return Boundary(f"binned on {name}", "triangles", "", *boundary(machine), wrong, cure, cost)
