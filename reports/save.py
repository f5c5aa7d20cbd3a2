"""Saving a plot: as pixels and as vectors, each with what it shows in words, for who cannot see it."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIXELS, VECTORS = ".png", ".svg"
DESCRIPTION = "Description"  # key of what a file shows, in both formats
FLAT = 4000  # colours up to which a palette of 256 shows a plot as it is; pictures have more
MOST_NAMES = 12  # panels, or series, that are named


def save_figure(fig: "Figure", path: Path, title: str) -> None:
    """Save a plot.

    Parameters
    ----------
    fig : Figure
    path : Path
        A file of any format of matplotlib's; without a suffix, a PNG and an SVG.
    title : str
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for file in [path] if path.suffix else [path.with_suffix(PIXELS), path.with_suffix(VECTORS)]:
        said = {"Title": title, DESCRIPTION: described(fig, title)}
        if file.suffix == PIXELS:
            _save_pixels(fig, file, said)
        else:
            fig.savefig(file, metadata={**said, "Date": None} if file.suffix == VECTORS else None)


def _save_pixels(fig: "Figure", path: Path, said: dict[str, str]) -> None:
    """Save as PNG, with a palette where the plot has few colours: that takes a third of the room."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    drawn = BytesIO()
    fig.savefig(drawn, format="png")
    picture = Image.open(drawn).convert("RGB")
    few = picture.getcolors(FLAT) is not None
    info = PngInfo()
    for key, text in said.items():
        info.add_itxt(key, text)
    (picture.quantize(dither=Image.Dither.NONE) if few else picture).save(path, optimize=True, pnginfo=info)


def description(path: Path) -> str:
    """What a PNG shows in words; empty where it does not say."""
    from PIL import Image

    with Image.open(path) as picture:
        return str(picture.info.get(DESCRIPTION, ""))


def described(fig: "Figure", title: str) -> str:
    """Say what a plot shows: its title, axes with their ranges, panels and series."""
    drawn = [axes for axes in fig.axes if axes.get_visible() and not _is_bar(axes)]
    panels = [axes for axes in drawn if axes.axison or axes.get_title(loc="left")]
    parts = [f"{title}."]
    if len(panels) > 1:
        parts.append(f"{len(panels)} panels: {_names([axes.get_title(loc='left') for axes in panels])}.")
    scaled = [axes for axes in panels if axes.axison]
    parts += [f"Up: {_along(scaled, 'y')}; across: {_along(scaled, 'x')}."] if scaled else []
    parts += [f"Colour: {bar.get_ylabel()}." for bar in fig.axes if _is_bar(bar)][:1]
    legends = [legend for axes in fig.axes if (legend := axes.get_legend())]
    series = dict.fromkeys(text.get_text() for legend in legends for text in legend.get_texts())
    parts += [f"Shown: {_names(list(series))}."] if series else []
    return " ".join(parts)


def _is_bar(axes: "Axes") -> bool:
    """Whether axes are a bar of colours beside others."""
    return axes.get_label() == "<colorbar>"


def _along(panels: "Sequence[Axes]", side: str) -> str:
    """What an axis is, with the ends of its scale in the first panel, or the names along it."""
    axis = getattr(panels[0], f"{side}axis")
    label = next((text for axes in panels if (text := getattr(axes, f"{side}axis").get_label_text())), "")
    ticks = [text for tick in axis.get_ticklabels() if (text := tick.get_text())]
    if ticks and not any(map(_is_number, ticks)):
        return f"{label + ': ' if label else ''}{_names(ticks)}"
    low, high = sorted(axis.get_view_interval())
    return f"{label or 'numbers'}, {low:.4g} to {high:.4g}"


def _is_number(tick: str) -> bool:
    """Whether a tick is a number: plain, or a power in TeX."""
    plain = tick.replace("\N{MINUS SIGN}", "-")
    return "$" in plain or plain.replace("e", "").replace("-", "").replace("+", "").replace(".", "").isdigit()


def _names(names: list[str]) -> str:
    named = [name.replace("\n", " ") for name in names if name]
    more = f" and {len(named) - MOST_NAMES} more" if len(named) > MOST_NAMES else ""
    return ", ".join(named[:MOST_NAMES]) + more
