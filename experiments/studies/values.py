"""Values of single parameters: what each takes, checked by itself, so that its place can be said.

A parameter is what every frame has (``SHARED``), ``machine`` or ``fidelity``, an option of the pipeline, a number of
the machine (``memory.dram_gb_per_s``), or a factor of one (``times.memory.dram_gb_per_s``).
"""

import re
from collections.abc import Iterable
from functools import cache
from typing import Any, get_type_hints

import msgspec

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import SECTIONS, Machine, altered
from tilestamp.models.machine_numbers import plain_number
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.options import checked
from tilestamp.simulator.pipelines import options_type

SHARED = {"pipeline": "micropolygon", "size": "1024x768", "camera": None, "zoom": 1.0, "orbit": 0.0}
PRICED = {"machine": "gtx280", "fidelity": "schedule"}
KNOWN = ("scene", *SHARED, *PRICED)
TIMES = "times."  # before the name of a number: a factor of it


def is_priced(name: str) -> bool:
    """Whether a parameter belongs to what a run is priced on; all others belong to what is executed."""
    return name in PRICED or "." in name


def is_whole(name: str, pipelines: Iterable[str]) -> bool:
    """Whether a parameter is a whole number."""
    if "." in name:
        return _is_whole_number(name)
    kinds = [f.type for p in pipelines for f in msgspec.structs.fields(options_type(p)) if f.name == name]
    return bool(kinds) and all(map(_takes_whole_numbers_only, kinds))


@cache
def _is_whole_number(key: str) -> bool:
    """Whether a number of a machine is a whole one; a factor is not."""
    return _hint(key) is not None and _takes_whole_numbers_only(_hint(key))


def _takes_whole_numbers_only(kind: object) -> bool:
    info = msgspec.inspect.type_info(kind)
    return isinstance(info, msgspec.inspect.IntType) or (
        isinstance(info, msgspec.inspect.LiteralType) and isinstance(info.values[0], int)
    )


@cache
def _hint(key: str) -> Any:
    """Type of a number of a machine; None of one in a table."""
    section, _, rest = key.partition(".")
    return get_type_hints(SECTIONS[section], include_extras=True).get(rest) if section in SECTIONS else None


def changed_number(machine: Machine, name: str, value: object) -> tuple[str, Any]:
    """Name and value of a changed number, checked by itself."""
    key = name.removeprefix(TIMES)
    if key not in machine.provenance:
        known = list(machine.provenance)
        raise TilestampError(f"{machine.name} has no number {key}{did_you_mean(key, known)}")
    value = plain_number(value)
    if name.startswith(TIMES):
        value = _multiplied(machine.number(key), value, whole=is_whole(key, []))
    if isinstance(value, float) and value.is_integer() and is_whole(key, []):
        value = int(value)
    try:
        msgspec.convert(value, _hint(key) or float)
    except msgspec.ValidationError:
        altered(machine, {key: value})  # it has the sentence
    return key, value


def _multiplied(number: object, factor: object, *, whole: bool) -> float:
    """A number of a machine times a factor, rounded where it is a whole one."""
    for part, what in ((number, "this"), (factor, "a factor")):
        if isinstance(part, bool) or not isinstance(part, int | float):
            raise TilestampError(f"{what} is a number in a product, and {part!r} is none")
    product = float(number) * float(factor)  # type: ignore[arg-type]  # both are numbers
    return round(product) if whole else product


def option(pipeline: str, name: str, value: object) -> Any:
    """Value of an option, checked."""
    kind = options_type(pipeline)
    types = {f.name: f.type for f in msgspec.structs.fields(kind)}
    if name not in types:
        known = [*types, *KNOWN]
        raise TilestampError(
            f"{name} is no option of the pipeline {pipeline}, and nothing else that a study can set"
            f"{did_you_mean(name, known)}; it has {', '.join(types) or 'none'}"
        )
    try:
        return checked(name, types[name], value)
    except TilestampError as error:
        if isinstance(value, list):
            raise TilestampError(f"{error}; several values make an axis, in [grid]") from error
        raise


def pixels(size: object) -> tuple[int, int]:
    """Width and height of ``1600x1200``."""
    match = re.fullmatch(r"([1-9]\d*)[xX]([1-9]\d*)", str(size))
    if match is None:
        raise TilestampError(f"a size is WIDTHxHEIGHT in pixels, such as 1600x1200, not {size}")
    return int(match[1]), int(match[2])
