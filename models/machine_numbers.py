"""Numbers of a machine as people give them: NumPy's, whole floats, those that no machine has, those of another warp."""

import reprlib
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import msgspec.structs
import numpy as np


def whole_numbers(values: dict[str, Any], struct: type[msgspec.Struct]) -> dict[str, Any]:
    """Values of a section, whole floats where an int belongs as such."""
    floats = {key: values[key] for key in _whole(struct) if isinstance(values.get(key), float)}
    return values | {key: int(value) for key, value in floats.items() if value.is_integer()}


@cache
def _whole(struct: type[msgspec.Struct]) -> set[str]:
    """Keys of a section that are whole numbers."""
    return {key for key, kind in get_type_hints(struct).items() if _is_whole(kind)}


def _is_whole(kind: object) -> bool:
    return kind is int or (get_origin(kind) is Literal and isinstance(get_args(kind)[0], int))


def plain_number(value: object) -> Any:
    """Make a number of NumPy one of Python, a lone one of an array too; leave the rest."""
    return value.item() if isinstance(value, np.generic | np.ndarray) and value.shape == () else value


def refusal(error: str, sections: dict[str, Any], structs: Mapping[str, type[msgspec.Struct]]) -> str:
    """Say which number no machine can have, and the range."""
    message, _, place = error.replace("`", "").partition(" - at $.")
    section, _, key = place.partition(".")
    values = sections.get(section, {})
    kind = get_type_hints(structs[section], include_extras=True).get(key) if section in structs else None
    if key == "per_clock[...]":  # a table of rates, all of one kind
        kind, values = (
            get_args(get_type_hints(structs[section], include_extras=True)["per_clock"])[1],
            values["per_clock"],
        )
        key = next(key for key, rate in values.items() if not within(rate, kind.__metadata__[0]))
        place = f"{section}.per_clock.{key}"
    limits = getattr(kind, "__metadata__", (None,))[0]
    if not isinstance(limits, msgspec.Meta):
        return f"{message} - at {place}"
    if limits.pattern is not None:
        return f"{place} is {reprlib.repr(values.get(key))}, not a text of two numbers as '9.0'"
    what = "a whole number" if get_args(kind)[0] is int else "a number"
    low = f"from {_read(limits.ge)}" if limits.gt is None else f"above {_read(limits.gt)}"
    value = reprlib.repr(values.get(key))
    return f"{place} is {value}, and no machine has that: it is {what} {low} to {_read(limits.le)}"


def within(rate: object, limits: msgspec.Meta) -> bool:
    """Whether a number is one within limits."""
    if not isinstance(rate, int | float) or isinstance(rate, bool):
        return False
    low = float(limits.ge or limits.gt or 0)
    above = low <= rate if limits.gt is None else low < rate
    return above and rate <= float(limits.le or 0)


def _read(limit: float | None) -> str:
    return f"{limit:,.0f}" if limit and limit >= 1 else f"{limit:g}"


def same_lanes(warp: int, issue: msgspec.Struct, pipe: msgspec.Struct, values: Mapping[str, Any]) -> dict[str, float]:
    """Cycles of an instruction where ``values`` give a warp another size: lanes a clock stay."""
    lanes = values.get("sm.warp_size")
    if not isinstance(lanes, int | float | np.number) or lanes == warp:
        return {}
    ratio = float(lanes) / warp
    slots = {f"issue.{name}": max(min(1.0, old), old * ratio) for name, old in msgspec.structs.asdict(issue).items()}
    return slots | {f"pipe.{name}": old * ratio for name, old in msgspec.structs.asdict(pipe).items()}
