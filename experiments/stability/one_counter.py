"""Every atomic on one counter: patches that want the same bucket (Eisenacher & Loop 2010, section 3.2).

"We have to deal with considerably less conflicting writes" with small tiles. The worst case is all patches in one tile:
all atomics of the address calculation queue at one address. Counters further apart do not help one counter; one atomic
for all lanes of a warp that want it does.
"""

from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import milliseconds, simt_of
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles

QUESTION = "What does it cost when all patches want the same bucket?"
PATCHES = 40_000
WIDTH, HEIGHT, TILE = 1600, 1200, 8  # pixels
SHARES = (0.0, 1e-4, 1e-3, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
MACHINES = ("gtx280", "h200")
VARIANTS = {"as published": (1, False), "padded to 32 bytes": (8, False), "one atomic a warp": (1, True)}
TWICE = 2.0  # a kernel that takes twice as long as without the crowd has broken
SEED = 7


def boxes(share: float) -> NDArray[np.float32]:
    """Boxes of patches, each inside one tile: a share of them, anywhere in the queue, in the same one."""
    rng = np.random.default_rng(SEED)
    columns, rows = WIDTH // TILE, HEIGHT // TILE
    tile = rng.integers(0, columns * rows, PATCHES)
    crowd = rng.permutation(PATCHES)[: round(share * PATCHES)]
    tile[crowd] = columns * rows // 2
    corner = np.stack([tile % columns, tile // columns], axis=1) * TILE
    return np.concatenate([corner + 2.0, corner + 5.0], axis=1).astype(np.float32)


@cache
def address_ms(share: float, machine: str, variant: str) -> float:
    """Modelled time of the address calculation."""
    padding, aggregate = VARIANTS[variant]
    tiles = screen_tiles(WIDTH, HEIGHT, TILE, 4)
    works = bucket_count(boxes(share), tiles, simt_of(machine), padding=padding, aggregate=aggregate).works
    return milliseconds([work for work in works if work.kernel == "address_calculation"], machine)


def boundary(machine: str, variant: str) -> tuple[float | None, float | None]:
    """Share of patches in one tile that holds, and that makes the kernel twice as slow."""
    return bisect(lambda share: _slow(share, machine, variant), SHARES[1], SHARES[-1], tolerance=0.1)


def _slow(share: float, machine: str, variant: str) -> bool:
    return address_ms(share, machine, variant) > TWICE * address_ms(0.0, machine, variant)


def run(progress: Progress) -> Result:
    """Sweep the share on two machines, with both cures."""
    rows = []
    for machine in MACHINES:
        progress(f"stability/one_counter: {machine}")
        rows += [
            {"machine": machine, "variant": variant, "share": share, "ms": address_ms(share, machine, variant)}
            for variant in VARIANTS
            for share in SHARES
        ]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(machine, variant) for machine in MACHINES for variant in VARIANTS]
    figures = [Figure(machine, partial(_plot, table[table.machine == machine], machine)) for machine in MACHINES]
    return atlas_result(
        "stability/one_counter", "Every atomic on one counter", boundaries, figures, _notes(), {"shares": table}
    )


def _boundary(machine: str, variant: str) -> Boundary:
    even, crowd = address_ms(0.0, machine, variant), address_ms(1.0, machine, variant)
    plain = address_ms(0.0, machine, "as published")
    published = variant == "as published"
    method = f"address calculation on {machine}, {variant}"
    wrong = f"atomics queue at one address: {crowd:.4g} ms with all patches in one tile, {even:.4g} ms without a crowd"
    cure = "one atomic for all lanes of a warp that want a counter" if published else ""
    cost = f"{address_ms(0.0, machine, 'one atomic a warp') - plain:+.4f} ms without a crowd" if published else ""
    return Boundary(method, "share of patches in one tile", "", *boundary(machine, variant), wrong, cure, cost)


def _notes() -> list[str]:
    """What the cures do where all are in one tile."""
    notes = []
    for machine in MACHINES:
        plain, padded, merged = (address_ms(1.0, machine, variant) for variant in VARIANTS)
        notes.append(
            f"{machine}, all {PATCHES} patches in one tile: padding takes {padded / plain:.2f} times the published"
            f" time, one atomic a warp {merged / plain:.2f} times."
        )
    return notes


def _plot(table: pd.DataFrame, machine: str, path: Path) -> None:
    lines(
        table[table.share > 0], path, x="share", y="ms", by="variant",
        title=f"Address calculation of {PATCHES} patches, {machine}", x_label="share of patches in one tile",
        y_label="time [ms]", log_x=True, log_y=True,
    )  # fmt: skip
