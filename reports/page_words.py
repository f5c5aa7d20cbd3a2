"""Words of the page: numbers as text, and terms of the glossary marked where they are first used."""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from markupsafe import Markup


@dataclass(frozen=True)
class Glossary:
    """Terms, each with ``id``, ``words`` and what it ``says``, in the order of the first word."""

    terms: Sequence[dict[str, Any]]

    @classmethod
    def read(cls, path: Path) -> "Glossary":
        """Read terms from a TOML file."""
        terms = tomllib.loads(path.read_text(encoding="utf-8"))["term"]
        named = [{"id": f"term-{term['words'][0].replace(' ', '-')}", **term} for term in terms]
        return cls(sorted(named, key=lambda term: str(term["words"][0]).lower()))

    def marked(self, text: str) -> "Markup":
        """Escape a sentence, and link the first use of each term to its explanation."""
        from markupsafe import Markup, escape

        by_word = {word: term for term in self.terms for word in term["words"]}
        words = "|".join(re.escape(word) for word in sorted(by_word, key=len, reverse=True))
        used: set[str] = set()

        def mark(found: re.Match[str]) -> str:
            term = by_word[found[0]]
            if term["id"] in used:
                return found[0]
            used.add(term["id"])
            return f'<a class="term" href="#{term["id"]}" data-says="{escape(term["says"])}">{found[0]}</a>'

        return Markup(re.sub(rf"(?<![\w#&-])(?:{words})(?![\w-])", mark, str(escape(text))))  # noqa: S704 - escaped


def number(value: float | str | None) -> str:
    """A value as text: four digits, thousands apart."""
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def percent(value: float | None, digits: int = 1) -> str:
    """A share as text."""
    return "" if value is None else f"{100 * value:.{digits}f} %"


def error(cell: dict[str, Any]) -> str:
    """How far a cell is off, as text."""
    if isinstance(cell["published"], str):
        return "as published" if cell["published"] == cell["ours"] else "differs"
    return "" if cell["error"] is None else f"{100 * cell['error']:+.1f} %"
