"""Options: one typed, frozen struct that the library, the command line and study files share.

A field is an option: its type says what it takes, and the string below it what it is. A value of another type, or
outside its choices or range, is a ``TilestampError`` of one sentence.
"""

import ast
import inspect
import math
import os
import textwrap
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar, get_args, get_origin

import msgspec
import numpy as np
from msgspec import inspect as types

from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.models.simt import Simt

if TYPE_CHECKING:
    from tilestamp.simulator.work import Work

MOST = 2**31  # kernels take 32-bit numbers
LARGEST = float(np.finfo(np.float32).max)


class Options(msgspec.Struct, frozen=True, kw_only=True):
    """Values of all options, checked: whole floats and NumPy's scalars have become what the field says."""

    persistent: ClassVar[bool] = False
    """Whether a kernel launches a number of blocks for each SM, which share out the work: by a queue, or evenly."""

    def __post_init__(self) -> None:
        for field in msgspec.structs.fields(self):
            value = checked(field.name, field.type, getattr(self, field.name))
            msgspec.structs.force_setattr(self, field.name, value)

    votes: ClassVar[bool] = False
    """Whether its kernels need ballots over warps of 32."""
    maps: ClassVar[dict[str, str]] = {}
    """Heat maps that it makes beside the picture, and what each shows."""
    patches: ClassVar[bool] = False
    """Whether it draws nothing but patches."""
    splats: ClassVar[bool] = False
    """Whether it draws splats, and nothing else."""
    textures: ClassVar[bool] = False
    """Whether it shows the textures of a mesh."""
    fixed_function: ClassVar[bool] = False
    """Whether it runs on the fixed-function pipe."""

    def launches(self, simt: Simt) -> list["Work"]:  # noqa: ARG002 - for those that have some
        """Launches whose blocks these options shape, without rows: what a machine may not be able to launch."""
        return []


OptionsT = TypeVar("OptionsT", bound=Options)


def make_options(kind: type[OptionsT], given: dict[str, Any], owner: str) -> OptionsT:
    """Build the struct ``kind`` from plain values; what is not given has its default.

    Raises
    ------
    TilestampError
        A name that ``owner`` has no option of, or a value that it does not take.
    """
    known = kind.__struct_fields__
    for name in given:
        if name not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise TilestampError(f"{owner} has no option {name}{did_you_mean(name, known)}; {has}")
    return kind(**given)


def plain(options: Options) -> dict[str, Any]:
    """All options by name as plain builtins, defaults included; ``make_options`` takes them back."""
    values: dict[str, Any] = msgspec.to_builtins(options, enc_hook=lambda array: array.tolist())
    return values


def checked(name: str, kind: object, value: object) -> Any:
    """Give ``value`` the type ``kind``; raises TilestampError with what the option ``name`` takes."""
    limit = ""
    for candidate in _readings(value):
        try:
            converted = msgspec.convert(candidate, kind, dec_hook=_array)
        except (msgspec.ValidationError, OverflowError):
            continue
        if _representable(converted):
            return converted
        limit = " that fits in 32 bits"
    shown = repr(value) if len(repr(value)) <= 40 else f"{repr(value)[:37]}..."
    raise TilestampError(f"{name} takes {takes(kind)}{limit}, not {shown}")


def _readings(value: object) -> list[object]:
    """What a value may stand for: itself, or the plain number of a NumPy scalar, a whole float, a path."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, list | tuple):
        value = [_readings(item)[-1] for item in value]
    if isinstance(value, float) and value.is_integer():
        return [value, int(value)]
    return [value]


def _array(kind: type, value: object) -> Any:
    """Turn nested lists, or numbers of another type, into an array of bytes."""
    if get_origin(kind) is np.ndarray and isinstance(value, list | np.ndarray):
        array = np.asarray(value, np.uint8)
        if not np.array_equal(array, value):
            raise ValueError("fractions are no bytes")
        return array
    return value


def _representable(value: object) -> bool:
    """Whether the numbers of a value are such that a kernel can take them."""
    if isinstance(value, tuple):
        return all(map(_representable, value))
    if isinstance(value, float):
        return math.isfinite(value) and abs(value) <= LARGEST
    return not isinstance(value, int) or abs(value) < MOST


def takes(kind: object) -> str:
    """Say what an option of a type takes: ``4, 8, 16 or 32``, ``a whole number from 1 to 16``."""
    *first, last = _said(types.type_info(kind)) if get_origin(kind) is not Literal else map(str, get_args(kind))
    return f"{', '.join(first)} or {last}" if first else last


def _said(info: types.Type) -> list[str]:
    """Say each thing that is taken."""
    match info:
        case types.UnionType(types=parts):
            return [said for part in parts for said in _said(part)]
        case types.LiteralType(values=values):
            return list(map(str, values))
        case types.BoolType():
            return ["true", "false"]
        case types.IntType():
            return [_number("a whole number", info)]
        case types.FloatType():
            return [_number("a number", info)]
        case types.VarTupleType(min_length=count):
            return [f"{count} of them"]
        case types.StrType():
            return ["text"]
        case types.NoneType():
            return ["none"]
        case _:
            return ["an array"]


def _number(noun: str, info: types.IntType | types.FloatType) -> str:
    """Say a number's range."""
    noun = f"a multiple of {info.multiple_of}" if info.multiple_of else noun
    low = f" from {info.ge}" if info.ge is not None else f" over {info.gt}" if info.gt is not None else ""
    high = f" to {info.le}" if info.le is not None else f" to below {info.lt}" if info.lt is not None else ""
    return f"{noun} of {info.ge} or more" if info.ge is not None and not high else noun + low + high


def choices(kind: object) -> list[Any]:
    """All values of a type that has a list of them or a range of whole numbers; none of others."""
    if get_origin(kind) is Literal:
        return list(get_args(kind))
    match types.type_info(kind):
        case types.IntType(ge=int(low), le=int(high), multiple_of=step):
            return list(range(low, high + 1, step or 1))
    return []


@cache
def descriptions(kind: type[Options]) -> dict[str, str]:
    """The strings below the fields, by field, each on one line."""
    found: dict[str, str] = {}
    for parent in reversed(kind.__mro__[: kind.__mro__.index(Options)]):
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(parent))).body
        assert isinstance(body, ast.ClassDef)  # noqa: S101 - it is the source of a class
        for field, below in pairwise(body.body):
            match field, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    found[name] = " ".join(text.split())
    return found
