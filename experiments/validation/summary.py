"""Short tables of a comparison: errors by kernel and quantity, by scene, and the fastest tile."""

from typing import TYPE_CHECKING

from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME, WALL

if TYPE_CHECKING:
    import pandas as pd

CLEAR = 0.10  # difference in time from which one tile size counts as faster


def judged(table: "pd.DataFrame") -> "pd.DataFrame":
    """Rows that are held to an aim: all counters, and the times of kernels that are not too short."""
    table = table[table.quantity != WALL]
    return table[(table.quantity != TIME) | (table.measured > SHORTEST_US)]


def by_kernel(table: "pd.DataFrame") -> "pd.DataFrame":
    """Mean and worst absolute error of each kernel and quantity."""
    rows = judged(table).assign(error=lambda t: t.error.abs())
    grouped = rows.groupby(["kernel", "spp", "quantity"], sort=False).error
    return grouped.agg(cells="size", mean="mean", worst="max").reset_index()


def by_scene(table: "pd.DataFrame") -> "pd.DataFrame":
    """Mean and worst absolute error of instructions and time, a scene left out of every fit a row."""
    rows = judged(table)
    rows = rows[rows.quantity.isin(["instructions", TIME])].assign(error=lambda t: t.error.abs())
    grouped = rows.groupby(["scene", "W", "quantity"], sort=False).error
    return grouped.agg(cells="size", mean="mean", worst="max").reset_index()


def fastest_tiles(table: "pd.DataFrame") -> "pd.DataFrame":
    """Fastest tile of the raster, measured and ours; ``clear`` where the runner-up is slower by a tenth or more."""
    import pandas as pd

    rows = table[(table.quantity == TIME) & (table.kernel == "k_raster")]
    found = []
    for (scene, spp), group in rows.groupby(["scene", "spp"], sort=False):
        times = group.set_index("tile")
        best = times.measured.idxmin()
        others = times.measured.drop(best)
        clear = bool(len(others)) and others.min() > (1 + CLEAR) * times.measured[best]
        found.append({"scene": scene, "spp": spp, "measured": best, "ours": times.ours.idxmin(), "clear": clear})
    return pd.DataFrame(found)
