"""Seconds against error of parts of a frame, both logarithmic, with the full runs beside them."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd

FLOOR = 1e-5  # where an error of none is drawn
STYLES = ("-", "--")


def sampling_plot(table: "pd.DataFrame", path: Path) -> None:
    """Draw a colour for each scene, a line for each method, a point for each rate; full runs as bars at the left.

    Parameters
    ----------
    table : DataFrame
        Columns scene, method, error, cpu_seconds, full_cpu_seconds.
    path : Path
        PNG to write.
    """
    title = "What a part of a frame costs at least (points), and all of it (bars at the left)"
    with figure(path, title, figsize=(8.6, 5.4)) as axes:
        styles = dict(zip(table.method.unique(), STYLES, strict=False))
        for i, (scene, rows) in enumerate(table.groupby("scene", sort=False)):
            color, marker = PALETTE[i % len(PALETTE)], "os^D"[i // len(PALETTE) % 4]
            for method, points in rows.groupby("method", sort=False):
                about = {"marker": marker, "markersize": 4, "linewidth": 1, "color": color}
                axes.plot(points.error.clip(lower=FLOOR), points.cpu_seconds, linestyle=styles[method], **about)
            axes.plot([], [], marker=marker, color=color, label=scene)
            axes.plot([FLOOR, 1.6 * FLOOR], 2 * [rows.full_cpu_seconds.iloc[0]], color=color, linewidth=3)
        for method, style in styles.items():
            axes.plot([], [], color="black", linestyle=style, label=method)
        axes.set(xscale="log", yscale="log", xlabel="mean error of the frame's time", ylabel="CPU seconds")
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
