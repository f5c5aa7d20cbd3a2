"""Timeline: rows over time, in a colour for what is done and as strong as it is."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

FAINTEST = 0.25  # of what is taken at all
WAITING = (0.88, 0.88, 0.88)


def timeline_plot(
    taken: NDArray[np.float64],
    kind: NDArray[np.int64],
    waits: NDArray[np.bool_],
    into: "Into",
    *,
    names: Sequence[str],
    title: str,
    x_label: str,
    y_label: str,
    end: float,
) -> "Axes":
    """Draw rows over time.

    Parameters
    ----------
    taken : ndarray, (rows, columns)
        0 (white) to 1.
    kind : ndarray, (columns,)
        Index into ``names``: the colour.
    waits : ndarray, (columns,), bool
        Where the rows wait for something else: grey, where nothing is taken.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    end : float
        Time of the last column's end.
    """
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    colors = np.array([to_rgb(PALETTE[index % len(PALETTE)]) for index in range(len(names))])
    strength = np.where(taken > 1e-9, FAINTEST + (1 - FAINTEST) * np.clip(taken, 0.0, 1.0), 0.0)[..., None]
    ground = np.where(waits[:, None], WAITING, 1.0)
    image = strength * colors[kind] + (1 - strength) * ground
    with figure(into, title, figsize=(11.0, 2.6 + 0.02 * len(taken))) as axes:
        axes.imshow(image, aspect="auto", extent=(0.0, end, len(taken) - 0.5, -0.5), interpolation="nearest")
        axes.grid(visible=False)
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set(xlabel=x_label, ylabel=y_label)
        handles = [Patch(color=color, label=name) for color, name in zip(colors, names, strict=True)]
        handles.append(Patch(color=WAITING, label="memory, atomics"))
        axes.legend(handles=handles, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    drawn: Axes = axes
    return drawn
