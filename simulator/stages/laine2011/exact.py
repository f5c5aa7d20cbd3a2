"""Arithmetic that CUDA has and Python lacks: one-rounding float32 fma, saturating conversions, coverage bits.

Each function is plain Python first, so that the kernels also run interpreted; compiled code gets the machine's own
instruction through an overload.
"""

from fractions import Fraction
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

from tilestamp.models.kernel import kernel

_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding and taking it away rounds a double to even


def fma(a: Any, b: Any, c: Any) -> Any:
    """Multiply and add with one rounding to float32 (two roundings, the first to odd, give the same)."""
    product = float(a) * float(b)  # exact: 48 bits
    total = product + float(c)
    if not np.isfinite(total):
        return np.float32(total)
    part = total - product
    error = (product - (total - part)) + (float(c) - part)
    bits = np.float64(total).view(np.int64)
    if error != 0.0 and bits % 2 == 0:
        bits += 1 if (error > 0) == (total > 0) else -1
    return np.float32(np.int64(bits).view(np.float64))


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_fma(_context: Any, a: Any, b: Any, c: Any) -> Any:
    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float32(a, b, c), codegen


@overload(fma, inline="never")
def _fma(a, b, c):  # type: ignore[no-untyped-def]
    if a == b == c == types.float32:
        return lambda a, b, c: _llvm_fma(a, b, c)  # noqa: PLW0108 - numba needs a function
    return None


def fma64(a: Any, b: Any, c: Any) -> Any:
    """Multiply and add with one rounding to float64."""
    if not np.isfinite([a, b, c]).all():
        return a * b + c
    return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_fma64(_context: Any, a: Any, b: Any, c: Any) -> Any:
    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float64(a, b, c), codegen


@overload(fma64, inline="never")
def _fma64(a, b, c):  # type: ignore[no-untyped-def]
    if a == b == c == types.float64:
        return lambda a, b, c: _llvm_fma64(a, b, c)  # noqa: PLW0108 - numba needs a function
    return None


def tile_bits(a: Any, b: Any, c: Any) -> Any:
    """Pixels of a tile of 8 x 8 at which none of three edge functions is negative, as a uint64.

    Parameters
    ----------
    a, b, c : tuple of int
        Of each edge: its value at the lower left pixel, what a step right takes from it, and what a step up adds. All
        sums are within int32.

    Returns
    -------
    uint64
        Pixel (x, y) at bit 8 * y + 7 - x.
    """
    edges = [tuple(map(int, edge)) for edge in (a, b, c)]
    pixels = [(x, y) for y in range(8) for x in reversed(range(8))]
    inside = [all(start - right * x + up * y >= 0 for start, right, up in edges) for x, y in pixels]
    return np.uint64(sum(1 << i for i, is_inside in enumerate(inside) if is_inside))


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_tile_bits(_context: Any, a: Any, b: Any, c: Any) -> Any:
    from llvmlite import ir

    lane, row = ir.IntType(32), ir.VectorType(ir.IntType(32), 8)

    def spread(builder: Any, value: Any) -> Any:
        one = builder.insert_element(ir.Constant(row, ir.Undefined), builder.trunc(value, lane), ir.Constant(lane, 0))
        return builder.shuffle_vector(one, ir.Constant(row, ir.Undefined), ir.Constant(row, [0] * 8))

    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        columns, word = ir.Constant(row, list(reversed(range(8)))), ir.IntType(64)
        edges = [[spread(builder, builder.extract_value(edge, i)) for i in range(3)] for edge in args]
        values = [builder.sub(start, builder.mul(right, columns)) for start, right, _ in edges]
        bits = ir.Constant(word, 0)
        for y in range(8):
            signs = builder.or_(builder.or_(values[0], values[1]), values[2])
            inside = builder.icmp_signed(">=", signs, ir.Constant(row, [0] * 8))
            eight = builder.zext(builder.bitcast(inside, ir.IntType(8)), word)
            bits = builder.or_(bits, builder.shl(eight, ir.Constant(word, 8 * y)))
            values = [builder.add(value, up) for value, (_, _, up) in zip(values, edges, strict=True)]
        return bits

    return types.uint64(a, b, c), codegen


@overload(tile_bits)
def _tile_bits(a, b, c):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda a, b, c: _llvm_tile_bits(a, b, c)  # noqa: PLW0108 - numba needs a function


@kernel(error_model="numpy", lent=True)
def lesser(a: Any, b: Any) -> Any:
    """Minimum that ignores NaN, as CUDA's does."""
    return b if a != a or b < a else a  # noqa: PLR0124 - only NaN differs from itself


@kernel(error_model="numpy", lent=True)
def greater(a: Any, b: Any) -> Any:
    """Maximum that ignores NaN, as CUDA's does."""
    return b if a != a or b > a else a  # noqa: PLR0124 - only NaN differs from itself


@kernel(lent=True)
def round_to_int32(value: Any) -> Any:
    """Float to int32: half to even, saturating, NaN to 0; returned as int64."""
    wide = np.float64(value) if value == value else 0.0  # noqa: PLR0124 - NaN differs from itself
    wide = min(max(wide, -2147483648.0), 2147483647.0)
    return np.int64((wide + _ROUND) - _ROUND)


@kernel(lent=True)
def round_to_uint32(value: Any) -> Any:
    """Float to uint32: half to even, saturating, negative and NaN to 0; returned as int64."""
    if not value > np.float32(0):
        return np.int64(0)
    wide = min(np.float64(value), 4294967295.0)
    return np.int64((wide + _ROUND) - _ROUND)


@kernel(lent=True)
def truncate_to_uint32(value: Any) -> Any:
    """Float to uint32 towards zero, saturating, negative and NaN to 0; returned as int64."""
    if not value > np.float32(0):
        return np.int64(0)
    return np.int64(min(np.float64(value), 4294967295.0))


@kernel(lent=True)
def wrap_int32(value: Any) -> Any:
    """Low 32 bits as a signed number."""
    return ((value + 2147483648) & 4294967295) - 2147483648


@kernel(lent=True)
def float_bits(value: Any) -> Any:
    """Bits of a float32 as a signed number."""
    return np.int64(np.float32(value).view(np.int32))


@kernel(lent=True)
def biased_exponent(value: Any) -> Any:
    """Exponent field of a float32; 0 for anything negative."""
    return max(float_bits(value), 0) >> 23
