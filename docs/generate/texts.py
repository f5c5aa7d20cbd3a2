"""Markdown from plain data."""

import inspect
import re
from collections.abc import Iterable, Sequence


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; a pipe or a line's end in a cell is none of the table's."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(_cell(value) for value in line) + " |" for line in lines) + "\n"


def _cell(value: object) -> str:
    return re.sub(r"\s*\n\s*", " ", str(value)).replace("|", "\\|")


def sections(docstring: str | None) -> dict[str, str]:
    """Parts of a docstring by their underlined titles; what stands before the first one is ""."""
    text = inspect.cleandoc(docstring or "")
    parts = re.split(r"^(.+)\n-{3,}\n", text, flags=re.MULTILINE)
    return {"": parts[0].strip()} | {title: body.strip() for title, body in zip(parts[1::2], parts[2::2], strict=True)}


def code(text: str) -> str:
    """ReStructuredText's ``code`` as Markdown's."""
    return text.replace("``", "`")
