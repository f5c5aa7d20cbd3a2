"""Seconds against error of sampled runs, both logarithmic."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd

FLOOR = 1e-5  # where a run that hit the number, or ran in full, is drawn


def sampling_plot(table: "pd.DataFrame", path: Path, *, aim: tuple[float, float]) -> None:
    """Draw a line for each scene, a point for each error asked; the bar is the half-width that the run claims.

    Parameters
    ----------
    table : DataFrame
        Columns scene, share_of_full, milliseconds_error, milliseconds_half_width.
    path : Path
        PNG to write.
    aim : tuple of float
        Relative error and share of the full run's seconds.
    """
    with figure(path, "What sampling saves: seconds against the error of the frame's time", figsize=(8.2, 5.2)) as axes:
        for i, (scene, rows) in enumerate(table.groupby("scene", sort=False)):
            color, marker = PALETTE[i % len(PALETTE)], "os^D"[i // len(PALETTE) % 4]
            error = rows.milliseconds_error.clip(lower=FLOOR)
            axes.plot(error, rows.share_of_full, marker=marker, markersize=5, linewidth=0.8, color=color, label=scene)
            right = rows.milliseconds_half_width.clip(lower=FLOOR)
            axes.hlines(
                rows.share_of_full, error.where(error < right, right), right, color=color, alpha=0.4, linewidth=3
            )
        axes.axvline(aim[0], color="black", linewidth=0.8, linestyle=":")
        axes.axhline(aim[1], color="black", linewidth=0.8, linestyle=":")
        axes.annotate("aim: 1 % at a tenth", aim, xytext=(-6, -12), textcoords="offset points", ha="right", fontsize=8)
        axes.axhline(1.0, color="#999999", linewidth=0.8)
        axes.set(xscale="log", yscale="log", ylim=(0.05, 3.0))
        axes.set_xlabel(f"relative error of the milliseconds (bar: half-width claimed; at {FLOOR:g}: none)")
        axes.set_ylabel("CPU seconds over those of the full run")
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
