"""A card: a heading, a picture and small tables as HTML that a notebook shows, in its own colours."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from jinja2 import Template

TEMPLATE = Path(__file__).with_name("templates") / "card.html"
LARGEST = 320  # pixels of a picture, in both directions


@dataclass(frozen=True)
class CardTable:
    """A table of texts.

    Parameters
    ----------
    title : str
    columns : sequence of str
        The first heads the names of rows.
    rows : sequence of sequences of str
    shares : sequence of sequences of float
        How strongly each cell is coloured, from 0 to 1, by row; without them none is.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    shares: Sequence[Sequence[float]] = ()

    @property
    def cells(self) -> list[list[tuple[str, float]]]:
        """Texts and shares, by row."""
        shares = self.shares or [[0.0] * len(row) for row in self.rows]
        return [list(zip(row, share, strict=True)) for row, share in zip(self.rows, shares, strict=True)]


def card(
    heading: str,
    tables: Sequence[CardTable],
    sentences: Sequence[str] = (),
    picture: NDArray[np.uint8] | None = None,
    alt: str = "",
) -> str:
    """Make the HTML.

    Parameters
    ----------
    heading : str
    tables : sequence of CardTable
        Each is folded by a click.
    sentences : sequence of str
        What else is to be said.
    picture : ndarray, (H, W, 3), uint8, optional
        Shown small.
    alt : str
        What the picture shows.
    """
    shown = _inlined(picture) if picture is not None else ""
    return _template().render(heading=heading, tables=tables, sentences=sentences, picture=shown, alt=alt)


@cache
def _template() -> "Template":
    from jinja2 import Environment

    return Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(TEMPLATE.read_text("utf-8"))


def _inlined(picture: NDArray[Any]) -> str:
    """A small PNG as the address of an image."""
    from PIL import Image

    small, data = Image.fromarray(picture), BytesIO()
    small.thumbnail((LARGEST, LARGEST))
    small.save(data, "png", optimize=True)
    return "data:image/png;base64," + b64encode(data.getvalue()).decode()
