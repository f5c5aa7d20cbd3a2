"""What a compiled kernel depends on, as a digest: its bytecode and all that it can reach from there.

Numba compiles bytecode, inlines what it calls, and freezes the globals that it reads. So the digest takes in, by name
and in the order of first use: the bytecode and constants of the kernel and of every kernel that it calls (with their
options), numbers, strings, tuples and arrays by value, and enums by their members. What is none of these (an intrinsic,
the stand-in of an overload) counts with its whole source file.
"""

import hashlib
import inspect
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

PACKAGE = __name__.split(".")[0]
_PLAIN = (int, float, complex, str, bytes, bool, type(None), np.generic, np.dtype)


def kernel_digest(function: Callable[..., Any]) -> str:
    """Digest of a function and all that it reaches, 24 hexadecimal digits.

    Parameters
    ----------
    function : callable
        Of Python, as written.
    """
    digest = hashlib.sha256()
    seen: set[int] = set()
    for part in _function(function, seen):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()[:24]


def _function(function: Any, seen: set[int]) -> Iterator[str]:
    """Describe a function: where it stands, its bytecode, and what its names mean."""
    if id(function) in seen:
        return
    seen.add(id(function))
    yield f"{function.__module__}.{function.__qualname__}"
    yield from _code(function.__code__)
    yield from _value(function.__defaults__, seen)
    for cell in function.__closure__ or ():
        yield from _value(cell.cell_contents, seen)
    names = list(dict.fromkeys(_names(function.__code__)))
    for name in names:
        if name in function.__globals__:
            yield name
            yield from _global(function.__globals__[name], names, seen)


def _global(value: object, names: list[str], seen: set[int]) -> Iterator[str]:
    """Describe what a global name means; of a module of ours, what those of the names mean that it has."""
    if isinstance(value, ModuleType):
        yield value.__name__
        if value.__name__.split(".")[0] == PACKAGE:
            for name in names:
                yield from _value(getattr(value, name, None), seen)
    else:
        yield from _value(value, seen)


def _code(code: CodeType) -> Iterator[str]:
    """Describe bytecode, without line numbers, comments and the docstring."""
    yield code.co_code.hex() + code.co_exceptiontable.hex()
    yield repr((code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
    documented = (
        bool(code.co_consts) and isinstance(code.co_consts[0], str) and bool(code.co_flags & inspect.CO_NEWLOCALS)
    )
    for constant in code.co_consts[1:] if documented else code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant)
        else:
            yield repr(constant)


def _names(code: CodeType) -> Iterator[str]:
    """Global and attribute names that bytecode uses, nested functions included."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _value(value: Any, seen: set[int]) -> Iterator[str]:
    """Describe a value by what a compiler sees of it."""
    if hasattr(value, "py_func"):
        yield str(sorted((name, str(option)) for name, option in value.targetoptions.items()))
        yield from _function(value.py_func, seen)
    elif isinstance(value, type) and issubclass(value, Enum):
        yield str([(member.name, member.value) for member in value])
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}{hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    elif isinstance(value, (tuple, list)):
        yield f"{type(value).__name__} of {len(value)}"
        for item in value:
            yield from _value(item, seen)
    elif isinstance(value, _PLAIN):
        yield f"{type(value).__name__} {value!r}"
    else:
        yield from _other(value)


def _other(value: Any) -> Iterator[str]:
    """Describe what is no plain value: by its name where it comes with a library, by its file where it is ours."""
    module = getattr(value, "__module__", None) or type(value).__module__
    yield f"{module} {getattr(value, '__qualname__', type(value).__qualname__)}"
    if module.split(".")[0] != PACKAGE:
        return
    yield from _file(inspect.getfile(value if isinstance(value, (FunctionType, type)) else value._defn))  # noqa: SLF001


@cache
def _file(path: str) -> tuple[str]:
    return (hashlib.sha256(Path(path).read_bytes()).hexdigest(),)
