"""``tilestamp validate``: the model beside a machine, by kernel and counter."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.outputs import check_file, writing
from tilestamp.experiments.commands.tables import print_table
from tilestamp.experiments.commands.terminal import progress
from tilestamp.experiments.validation.summary import by_kernel, fastest_tiles
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.models.paths import is_folder


def validate(
    *,
    measurements: Path | None = None,
    machine: str = "h200",
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Print model against machine: by kernel and counter, from stored measurements, or on the GPU of this computer.

    Parameters
    ----------
    measurements
        Folder of measurements (micropolygon.csv with its cameras, freepipe.csv with its inputs); without it, CUDA
        versions of our kernels run on the GPU of this computer.
    machine
        Machine, or machine file, that is to predict them.
    output
        CSV file for every compared number.
    """
    model = load_machine(machine)
    if output is not None:
        check_file(output, "-o", ".csv")
    with progress("validating") as say:
        if measurements is None:
            from tilestamp.experiments.validation.on_gpu import compare_here

            table, remarks = compare_here(model, say)
        else:
            if not is_folder(measurements):
                raise TilestampError(f"{measurements} is not a folder of measurements")
            from tilestamp.experiments.validation.stored import compare, executions

            table, remarks = compare(measurements, executions(measurements, model, say)), []
    if output is not None:
        with writing(output) as partial:
            table.to_csv(partial, index=False)
    rows = [
        [r.kernel, str(r.spp or ""), r.quantity, str(r.cells), f"{r['mean']:.3f}", f"{r.worst:.3f}"]
        for _, r in by_kernel(table).iterrows()
    ]
    columns = ["kernel", "spp", "quantity", "cells", "mean", "worst"]
    print_table(f"Model against machine ({model.name})", columns, rows, [""] * len(rows))
    for remark in remarks:
        sys.stdout.write(f"! {remark}\n")
    tiles = fastest_tiles(table)
    if len(tiles):
        right = int(((tiles.ours == tiles.measured) | ~tiles.clear).sum())
        sys.stdout.write(f"fastest tile: right in {right} of {len(tiles)} (a difference below 10 % is no difference)\n")
