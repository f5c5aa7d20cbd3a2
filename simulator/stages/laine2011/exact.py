"""Arithmetic that CUDA has and Python lacks: one-rounding float32 fma, saturating conversions.

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
    if not value == value:  # noqa: PLR0124, SIM201 - NaN, and nothing else, differs from itself
        return np.int64(0)
    wide = min(max(np.float64(value), -2147483648.0), 2147483647.0)
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
