"""Why: a sentence a stage. What holds its time, how far the next limit is, and what would move it most."""

from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.simulator.sensitivity import FRAME, Sensitivity

if TYPE_CHECKING:
    import pandas as pd

MEANING = {
    "issue": "its instructions fill the schedulers or an execution unit",
    "shared": "its accesses fill the banks of shared memory",
    "l1": "its bytes fill the load and store path of the SMs",
    "latency": "its units wait for their own dependent loads and instructions",
    "dram": "its bytes fill the bandwidth of DRAM",
    "l2": "its bytes fill the bandwidth of L2",
    "atomics": "its atomics fill the atomic units, or queue at one",
    "start": "blocks start one after another, at the machine's rate",
    "launch": "starting its kernels takes time by itself",
    "balance": "it has fewer units of work than there are SMs, so some are idle",
    "tail": "its last units run on while the places of others are empty",
}
LITTLE = 0.005  # relative: less is not worth a word


def sentences(found: Sensitivity) -> dict[str, str]:
    """A sentence for each stage, those that take longest first."""
    longest = found.limits.sort_values("milliseconds", ascending=False, kind="stable")
    frame = found.free.loc[FRAME, "now"]
    return {
        str(stage): f"{row['milliseconds']:.4g} ms, {_percent(row['milliseconds'] / frame)} of the frame, "
        f"{_held(row)}; {_moved(found, str(stage))}"
        for stage, row in longest.iterrows()
    }


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else "all"


def _held(row: "pd.Series[Any]") -> str:
    """What holds, and how far the next limit is."""
    term, factor = row["holds"], row["milliseconds"] / row["without"] if row["without"] else np.inf
    if factor < 1 + LITTLE:
        return "held by several things at once: none that is free alone makes it faster"
    meaning = MEANING.get(term, f"its items fill the fixed-function unit {term}")
    after = f"{row['without']:.4g} ms without that, {factor:.3g} times faster, held by {row['next']}"
    return f"held by {term} ({meaning}); {after}"


def _moved(found: Sensitivity, stage: str) -> str:
    """Name the numbers that move it most, by the part that they move it for their own change."""
    best = movers(found.numbers[found.numbers["stage"] == stage])
    if not len(best):
        return "no number of the machine moves it"
    told = [
        f"{row.number} {plain(row.value)} -> {plain(row.to)} ({100 * (row.time - 1):+.1f} %)"
        for row in best.itertuples()
    ]
    return f"moved most by {' and '.join(told)}"


def movers(numbers: "pd.DataFrame", most: int = 2) -> "pd.DataFrame":
    """Rows of the numbers that make a stage faster, most for their own change first; ``to`` and ``time`` are after it.

    A number and a whole number are compared by log time / log number.
    """
    falls = numbers["less"].fillna(np.inf) < numbers["more"].fillna(np.inf)
    changed = numbers.assign(
        to=numbers["lower"].where(falls, numbers["higher"]), time=numbers["less"].where(falls, numbers["more"])
    )
    changed = changed[changed["time"] < 1 - LITTLE]
    change = np.log(changed["time"]) / np.log(changed["to"].clip(lower=1e-12) / changed["value"])
    return changed.loc[change.abs().sort_values(ascending=False, kind="stable").index[:most]]


def plain(value: float) -> str:
    """A number of a machine as it is written, to five digits where it is not whole."""
    return f"{value:g}" if float(value).is_integer() else f"{value:.5g}"
