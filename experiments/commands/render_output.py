"""What ``tilestamp render`` leaves: a picture, a heat map, the table of stages or the run as JSON."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.commands.terminal import print_table, writing
from tilestamp.models.error_model import was_measured
from tilestamp.simulator.run import Run
from tilestamp.simulator.run_views import draw

FORMATS = {"count": ",.0f", "bytes": ",.0f", "ratio": ".4f", "distribution": ",.1f"}  # by kind of a counter
COST = {"blocks": ",.0f", "warps": ",.0f", "instructions": ",.0f", "simd_efficiency": ".3f"}  # before counters
TIME = {  # after them
    "atomics": ",.0f",
    "occupancy": ".2f",
    "achieved_occupancy": ".2f",
    "milliseconds": ".3f",
    "bound": "s",
}


def write_png(image: NDArray[np.uint8], path: Path) -> None:
    """Write a picture, all of it or nothing."""
    from PIL import Image

    partial = path.with_suffix(".partial")
    with writing(path):
        try:
            Image.fromarray(image).save(partial, format="png")
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def map_path(output: Path, name: str) -> Path:
    """File of a counter's heat map: ``out.tests.png`` beside ``out.png``."""
    return output.with_suffix(f".{name}.png")


def write_map(run: Run, name: str, path: Path) -> None:
    """Draw a counter's heat map."""
    with writing(path):
        draw(run, "map", path, name)


def as_json(run: Run) -> dict[str, Any]:
    """The run as plain data; not-a-number becomes null."""
    stages = run.stages.astype(object).to_dict(orient="index") if run.counted else {}
    return {
        "scene": run.scene,
        "note": run.note,
        "pipeline": run.pipeline,
        "machine": run.machine.name,
        "width": run.width,
        "height": run.height,
        "fidelity": run.fidelity,
        "options": run.options,
        "milliseconds": run.milliseconds if run.counted else None,
        "error_interval_milliseconds": _plain(run.error_interval) if _error_is_known(run) else None,
        **_sampling(run),
        "stages": {stage: {key: _plain(value) for key, value in row.items()} for stage, row in stages.items()},
        "counters": {name: {"title": c.title, "kind": c.kind} for name, c in run.counters.items()},
        "counts": run.counts if run.counted else {},
        "facts": {key: _plain(value) for key, value in run.frame.facts.items()},
        "warnings": list(run.frame.remarks),
        "manifest": run.manifest(),
    }


def _sampling(run: Run) -> dict[str, Any]:
    """What was sampled, and the intervals; nothing for a run that executed everything."""
    if not run.sampled:
        return {}
    return {
        "error": run.error,
        "sampled": _plain(run.sampled),
        "intervals": {f"{stage}.{name}": list(estimate) for (stage, name), estimate in run.intervals.items()},
    }


def _plain(value: object) -> object:
    """NumPy scalars and containers as JSON knows them."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    value = value.tolist() if hasattr(value, "tolist") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_run(run: Run, output: Path | None, map_: str | None = None) -> None:
    """Print the table of stages, and a line for all else that is to be said."""
    title = f"{run.scene} by {run.pipeline} on {run.machine.name}, {run.width}x{run.height}"
    if run.counted:
        counted = {name: FORMATS[counter.kind] for counter in run.counters.values() for name in counter.columns}
        columns = {name: kind for name, kind in (COST | counted | TIME).items() if name in run.stages}
        rows = [
            [str(stage), *("" if value != value else format(value, columns[name]) for name, value in row.items())]  # noqa: PLR0124 - not-a-number
            for stage, row in run.stages[list(columns)].to_dict(orient="index").items()
        ]
        print_table(f"{title}: {_shown_time(run)}", ["stage", *columns], rows)
    else:
        sys.stdout.write(f"{title}: nothing was counted, so there is no time\n")
    lines = [
        _shown_error(run),
        run.note,
        *run.frame.remarks,
        _shown_sample(run),
        f"picture: {output}" if output else "",
    ]
    lines += [f"map of {map_}: {map_path(output, map_)}"] if output and map_ else []
    sys.stdout.writelines(f"{line}\n" for line in lines if line)


def _shown_time(run: Run) -> str:
    """Show the frame's milliseconds, with their interval where the run was sampled."""
    if not run.sampled:
        return f"{run.milliseconds:.2f} ms"
    return f"{run.milliseconds:.2f} ms +- {run.milliseconds_interval.half_width:.2g} (95 %)"


def _shown_error(run: Run) -> str:
    """Say how far the frame's time may be from a real machine's."""
    if not _error_is_known(run):
        return ""
    low, high = run.error_interval
    there = (
        f"kernel times measured on {run.machine.name}"
        if was_measured(run.machine)
        else "published times of other machines"
    )
    return f"expect {low:.4g} to {high:.4g} ms: 95 % of the {there} were that near"


def _error_is_known(run: Run) -> bool:
    """Whether the frame has a time, by the schedule: the residuals are of such times."""
    return run.counted and run.fidelity == "schedule" and run.milliseconds == run.milliseconds


def _shown_sample(run: Run) -> str:
    """Say which part was executed, and how sure the main numbers are."""
    if not run.sampled:
        return ""
    parts = ", ".join(f"{ran} of {units} units of {kernel}" for kernel, (ran, units) in run.sampled["units"].items())
    wide = ", ".join(
        f"{name.replace('_', ' ')} {100 * estimate.relative:.2g} %"
        for (stage, name), estimate in run.intervals.items()
        if stage == "frame"
    )
    return f"executed: {parts}\n95 % intervals of the frame, half-width: {wide}"
