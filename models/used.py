"""What a result was made from: whoever loads or prices notes it, whoever writes a manifest collects it."""

from collections.abc import Iterator
from contextlib import contextmanager

Used = dict[str, dict[str, set[str]]]
"""Kind ("machines", "mixes"...), name, and the digests of all that bore it; of fitted numbers the cells fitted to."""
FITTED, CHOSEN = "fitted numbers", "chosen inputs"
_collecting: list[Used] = []


def collecting() -> bool:
    """Whether anybody collects."""
    return bool(_collecting)


def note(kind: str, name: str, digest: str) -> None:
    """Say that something is used now."""
    for found in _collecting:
        found.setdefault(kind, {}).setdefault(name, set()).add(digest)


def note_again(found: Used) -> None:
    """Note all that was collected before."""
    if not _collecting:
        return
    for kind, names in found.items():
        for name, digests in names.items():
            for digest in digests:
                note(kind, name, digest)


@contextmanager
def collect() -> Iterator[Used]:
    """Collect what is noted meanwhile."""
    found: Used = {}
    _collecting.append(found)
    try:
        yield found
    finally:
        _collecting[:] = [other for other in _collecting if other is not found]
