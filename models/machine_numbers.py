"""Numbers of a machine as people give them: NumPy's, whole floats, those that no machine has, those of another warp."""

from collections.abc import Mapping
from typing import Any, get_type_hints

import msgspec
import msgspec.structs
import numpy as np


def plain_numbers(values: dict[str, Any], struct: type[msgspec.Struct]) -> dict[str, Any]:
    """Numbers of NumPy, and whole floats where an int belongs, as Python's own."""
    kinds = get_type_hints(struct)
    plain = {key: plain_number(value) for key, value in values.items()}
    return {
        key: int(value) if kinds.get(key) is int and isinstance(value, float) and value.is_integer() else value
        for key, value in plain.items()
    }


def plain_number(value: object) -> Any:
    """Make a number of NumPy one of Python; leave the rest."""
    return value.item() if isinstance(value, np.generic) else value


def refusal(error: str, sections: dict[str, Any], structs: Mapping[str, type[msgspec.Struct]]) -> str:
    """Say which number no machine can have, and the range."""
    message, _, place = error.replace("`", "").partition(" - at $.")
    section, _, key = place.partition(".")
    field = get_type_hints(structs[section], include_extras=True).get(key) if section in structs else None
    value = sections.get(section, {}).get(key)
    limits = getattr(field, "__metadata__", (None,))[0]
    if not isinstance(limits, msgspec.Meta) or isinstance(value, str | bool):
        return f"{message} - at {place}"
    low, high = limits.ge if limits.gt is None else limits.gt, limits.le
    kind = "a whole number" if get_type_hints(structs[section])[key] is int else "a number"
    return f"{place} is {value}, and no machine has that: it is {kind} from {_read(low)} to {_read(high)}"


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
