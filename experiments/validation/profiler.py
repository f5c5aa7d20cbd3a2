"""Hardware counters of our kernels on the GPU at hand, by NVIDIA's command-line profiler where it is installed."""

import csv
import io
import shutil
import subprocess
import sys
from collections.abc import Iterator

from tilestamp.experiments.validation.quantities import QUANTITIES

KERNELS = "address_calculation|bucket_write|tile_raster|freepipe|freepipe_early|triangle_setup"
LANES, INSTRUCTIONS = "smsp__thread_inst_executed.sum", "smsp__inst_executed.sum"
EFFICIENCY = "derived.simd_efficiency"
SECONDS = 400


def metrics() -> list[str]:
    """Metrics to ask for: those of every compared quantity; efficiency is derived from lanes and instructions."""
    asked = [metric for quantity in QUANTITIES for metric in quantity.metrics if metric != EFFICIENCY]
    return list(dict.fromkeys([*asked, LANES, INSTRUCTIONS]))


def counters() -> tuple[list[dict[str, float]], str]:
    """Counters of every launch, in the order of ``gpu_cases``; and a sentence where there are none.

    Returns
    -------
    rows : list of dict
        Metric to value, a row a launch; empty where the profiler is missing or may not read.
    why : str
        Empty where it could read.
    """
    ncu = shutil.which("ncu")
    if ncu is None:
        return [], "no counters: NVIDIA's profiler ncu is not installed here"
    command = [ncu, "--csv", "--page", "raw", "--clock-control", "none", "--kernel-name", f"regex:^({KERNELS})$"]
    command += ["--metrics", ",".join(metrics()), sys.executable, "-m", "tilestamp.experiments.validation.launch_once"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)  # noqa: S603 - ours
    except subprocess.TimeoutExpired:
        return [], f"no counters: the profiler did not end within {SECONDS} seconds"
    if "ERR_NVGPUCTRPERM" in done.stdout + done.stderr:
        return [], "no counters: this driver lets only an administrator read them (ERR_NVGPUCTRPERM)"
    rows = list(read_counters(done.stdout))
    tail = (done.stderr or done.stdout).strip().splitlines()[-1:]
    return rows, "" if rows else f"no counters: the profiler said {tail[0] if tail else 'nothing'}"


def read_counters(text: str) -> Iterator[dict[str, float]]:
    """Rows of the profiler's CSV: after its header there is a row of units, then a row a launch."""
    lines = [line for line in text.splitlines() if line.startswith('"')]
    for row in csv.DictReader(io.StringIO("\n".join(lines))):
        if not row.get("ID"):
            continue  # the units
        found = {key: float(value.replace(",", "")) for key, value in row.items() if key in metrics() and value}
        if found.get(INSTRUCTIONS):
            found[EFFICIENCY] = found[LANES] / (32.0 * found[INSTRUCTIONS])
        yield found
