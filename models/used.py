"""What a result was made from: whoever loads or prices notes it, whoever writes a manifest collects it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
Used = dict[str, dict[str, set[str]]]
"""Kind ("machines", "mixes"...), name, and the digests of all that bore it."""
_collecting: list[Used] = []


def note(kind: str, name: str, digest: str) -> None:
    """Say that something is used now."""
    for found in _collecting:
        found.setdefault(kind, {}).setdefault(name, set()).add(digest)


@contextmanager
def collect() -> Iterator[Used]:
    """Collect what is noted meanwhile."""
    found: Used = {}
    _collecting.append(found)
    try:
        yield found
    finally:
        _collecting[:] = [other for other in _collecting if other is not found]


def remembered(function: Callable[P, T]) -> Callable[P, T]:
    """Cache as ``functools.cache`` does, and note anew at each call what the value was made from."""

    @cache
    def made(*args: P.args, **kwargs: P.kwargs) -> tuple[T, Used]:
        with collect() as found:
            return function(*args, **kwargs), found

    @wraps(function)
    def again(*args: P.args, **kwargs: P.kwargs) -> T:
        value, found = made(*args, **kwargs)  # type: ignore[arg-type]  # hashable, as a cache needs them
        for kind, names in found.items():
            for name, digests in names.items():
                for digest in digests:
                    note(kind, name, digest)
        return value

    return again
