"""Bits of a uint64, as a warp's ballots and masks have them.

Each function is plain Python first, so that the kernels also run interpreted; compiled code gets the machine's own
instruction through an overload.
"""

from typing import Any

from numba import types
from numba.extending import intrinsic, overload


def popcount(bits: Any) -> Any:
    """Set bits of a uint64."""
    return int(bits).bit_count()


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_popcount(_context: Any, bits: Any) -> Any:
    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.ctpop(args[0])

    return types.int64(bits), codegen


@overload(popcount)
def _popcount(bits):  # type: ignore[no-untyped-def]
    return (lambda bits: _llvm_popcount(bits)) if bits == types.uint64 else None  # noqa: PLW0108 - numba needs a function


def lowest_bit(bits: Any) -> Any:
    """Index of the lowest set bit of a uint64 that has one."""
    return (int(bits) & -int(bits)).bit_length() - 1


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_lowest_bit(_context: Any, bits: Any) -> Any:
    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], _true())

    return types.int64(bits), codegen


def _true() -> Any:  # the count for zero is left undefined
    from llvmlite import ir

    return ir.Constant(ir.IntType(1), 1)


@overload(lowest_bit)
def _lowest_bit(bits):  # type: ignore[no-untyped-def]
    return (lambda bits: _llvm_lowest_bit(bits)) if bits == types.uint64 else None  # noqa: PLW0108 - numba needs a function
