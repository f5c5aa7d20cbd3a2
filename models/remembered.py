"""Values that are kept: they note anew what they were made from, and follow a fitted number that is moved."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, Generic, ParamSpec, TypeVar, overload

from tilestamp.models.fitted import moved, moving
from tilestamp.models.used import CHOSEN, FITTED, Used, collect, note_again

P = ParamSpec("P")
T = TypeVar("T")


def remembered(function: Callable[P, T]) -> Callable[P, T]:
    """Cache as ``functools.cache`` does, and note anew at each call what the value was made from.

    Where an input that it was made from is moved (``tilestamp.models.fitted``), another value is made, and kept beside
    it; prices are not the function's business, but of what it gives (``priced_property``).
    """

    @cache
    def made(move: str, *args: P.args, **kwargs: P.kwargs) -> tuple[T, Used]:
        with moving(move), collect() as found:
            return function(*args, **kwargs), found

    @wraps(function)
    def again(*args: P.args, **kwargs: P.kwargs) -> T:
        value, found = made("", *args, **kwargs)  # type: ignore[arg-type]  # hashable, as a cache needs them
        if moved() in found.get(CHOSEN, ()):
            value, found = made(moved(), *args, **kwargs)  # type: ignore[arg-type]
        note_again(found)
        return value

    return again


class priced_property(Generic[T]):  # noqa: N801 - used as cached_property is
    """``functools.cached_property`` for prices: made again while a fitted number is moved, and noted at each access."""

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function = function
        self.__doc__ = function.__doc__
        self.name = function.__name__

    @overload
    def __get__(self, instance: None, owner: type) -> "priced_property[T]": ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> "priced_property[T] | T":
        """The value under the number that is moved now; of those under a move only the last ones are kept."""
        if instance is None:
            return self
        value, found = self._made(instance, "")
        if moved() in found.get(FITTED, ()):
            value, found = self._made(instance, moved())
        note_again(found)
        return value

    def _made(self, instance: object, move: str) -> tuple[T, Used]:
        kept: dict[str, dict[str, tuple[T, Used]]] = instance.__dict__.setdefault("_priced", {"": {}})
        if move not in kept:
            kept = instance.__dict__["_priced"] = {"": kept[""], move: {}}
        if self.name not in kept[move]:
            with moving(move), collect() as found:
                kept[move][self.name] = self.function(instance), found
        return kept[move][self.name]
