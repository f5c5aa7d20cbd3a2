"""``tilestamp measure-machine``: describe the GPU at hand by measuring it."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.outputs import check_file, writing
from tilestamp.experiments.commands.tables import print_table
from tilestamp.experiments.commands.terminal import progress
from tilestamp.models.machine import load_machine


def measure_machine(*, output: Annotated[Path, Parameter(name=["--output", "-o"])], base: str = "h200") -> None:
    """Run micro-benchmarks on the GPU of this computer and write a machine file, each number with its provenance.

    Parameters
    ----------
    output
        The machine file to write (TOML).
    base
        Machine from which the few numbers come that no micro-benchmark gives.
    """
    check_file(output, "-o", ".toml")
    from tilestamp.experiments.validation.gpu import cupy
    from tilestamp.experiments.validation.machine_file import busy, machine_file
    from tilestamp.experiments.validation.measure import measure

    cp = cupy()
    properties = cp.cuda.runtime.getDeviceProperties(cp.cuda.Device().id)
    gpu = properties["name"].decode()
    capability = f"{properties['major']}.{properties['minor']}"
    numbers = []
    with progress("measuring") as say:
        for number in measure():
            say(f"{number.key} = {number.value:.5g}")
            numbers.append(number)
    text = machine_file(numbers, load_machine(base), output.stem, f"{gpu}, measured", capability)
    with writing(output) as partial:
        partial.write_text(text, "utf-8")
    load_machine(output)
    rows = [[n.key, f"{n.value:.5g}", f"{100 * n.spread:.1f} %", n.how] for n in numbers]
    print_table(f"{gpu}: {output}", ["number", "value", "spread", "how"], rows)
    for key in busy(numbers):
        sys.stdout.write(f"! repeats of {key} disagree: is something else running on this GPU?\n")
