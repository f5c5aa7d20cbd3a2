"""Memory that is needed soon: fetched while something else is computed."""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload


def prefetch(array: Any, i: Any) -> None:
    """Have row i of an array, or element i, brought into the cache; interpreted code does without."""


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_prefetch(_context: Any, array: Any, i: Any) -> Any:
    from llvmlite import ir

    byte, word = ir.IntType(8), ir.IntType(32)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        made = context.make_array(signature.args[0])(context, builder, value=args[0])
        stride = cgutils.unpack_tuple(builder, made.strides)[0]
        row = builder.gep(builder.bitcast(made.data, byte.as_pointer()), [builder.mul(args[1], stride)])
        kind = ir.FunctionType(ir.VoidType(), [byte.as_pointer(), word, word, word])
        fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(fetch, [row, *(ir.Constant(word, option) for option in (0, 3, 1))])  # to read, to keep, data
        return context.get_dummy_value()

    return types.void(array, i), codegen


@overload(prefetch)
def _prefetch(array, i):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda array, i: _llvm_prefetch(array, i)  # noqa: PLW0108 - numba needs a function
