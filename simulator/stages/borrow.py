"""Arrays without reference counts, for kernels that pass them through many small functions.

Compiled code counts references to an array with locked instructions. A kernel that hands arrays on for every triangle
spends more time there than on the triangle, and threads that share an array fight over its counter.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload


def borrow(arrays: Any) -> Any:
    """View an array, or a tuple of arrays, that the caller keeps alive; interpreted code gets it back as it is."""
    return arrays


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Clear the owner of an array value, or of all arrays in a tuple value."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()  # noqa: SLF001 - the documented way to build a value
    if isinstance(kind, types.BaseTuple):
        for i, part in enumerate(kind.types):
            cleared = _without_owner(context, builder, part, builder.extract_value(value, i))
            value = builder.insert_value(value, cleared, i)
    return value


@intrinsic  # type: ignore[untyped-decorator]
def _borrow(_context: Any, arrays: Any) -> Any:
    def codegen(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return _without_owner(context, builder, arrays, args[0])

    return arrays(arrays), codegen


@overload(borrow)
def _borrow_compiled(arrays):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda arrays: _borrow(arrays)  # noqa: PLW0108 - numba needs a function


def row_of(table: Any, i: int) -> Any:
    """Row i of a table, or None where there is no table: what compiled code cannot say without both types."""
    return None if table is None else table[i]


@overload(row_of)
def _row_of(table, i):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    if isinstance(table, types.NoneType):
        return lambda table, i: None  # noqa: ARG005 - numba compares signatures
    return lambda table, i: table[i]
