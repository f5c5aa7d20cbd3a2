"""Bits of a uint64, as a warp's ballots and masks have them; which lanes of a warp want addresses close together.

Each function is plain Python first, so that the kernels also run interpreted; compiled code gets the machine's own
instruction through an overload.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

from tilestamp.models.kernel import kernel

LANES = 8  # that compiled code compares at once


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


@kernel(lent=True)
def lowest_bits(bits: Any, count: int) -> Any:
    """The lowest ``count`` set bits of a uint64; all of them where it has no more."""
    if popcount(bits) <= count:
        return bits
    below, step = np.uint64(0), np.uint64(32)
    while step != np.uint64(0):
        further = (np.uint64(1) << (below + step)) - np.uint64(1)
        below += step if popcount(bits & further) <= count else np.uint64(0)
        step >>= np.uint64(1)
    return bits & ((np.uint64(1) << below) - np.uint64(1))


def _near(addresses: Any, first: int, here: Any, size: Any) -> Any:
    """Which of eight lanes from ``first`` on differ from an address in no bit but those below ``size``."""
    return sum(int(0 <= (int(addresses[first + i]) ^ int(here)) < size) << i for i in range(LANES))


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_near(_context: Any, addresses: Any, _first: Any, _here: Any, _size: Any) -> Any:
    from llvmlite import ir

    word, row, index = ir.IntType(64), ir.VectorType(ir.IntType(64), LANES), ir.IntType(32)

    def spread(builder: Any, value: Any) -> Any:
        one = builder.insert_element(ir.Constant(row, ir.Undefined), value, ir.Constant(index, 0))
        return builder.shuffle_vector(
            one, ir.Constant(row, ir.Undefined), ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        )

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, value=args[0])
        lanes = builder.bitcast(builder.gep(array.data, [args[1]]), row.as_pointer())
        apart = builder.xor(builder.load(lanes, align=8), spread(builder, args[2]))
        near = builder.icmp_unsigned("<", apart, spread(builder, args[3]))
        return builder.zext(builder.bitcast(near, ir.IntType(LANES)), word)

    return types.int64(addresses, types.intp, types.int64, types.int64), codegen


@overload(_near)
def _near_compiled(addresses, first, here, size):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    if addresses != types.int64[::1]:
        return None
    return lambda addresses, first, here, size: _llvm_near(addresses, first, here, size)  # noqa: PLW0108 - as above


@kernel(lent=True)
def lanes_near(addresses: Any, first: int, end: int, here: int, size: int) -> Any:
    """Lanes ``first``..``end - 1``, a bit each, at addresses in one aligned segment of ``size`` bytes with ``here``.

    Two addresses are in one when they differ only in the bits below its size; an inactive lane, whose address is
    negative, differs in the sign bit.
    """
    lanes, lane = 0, first
    while lane + LANES <= end:
        lanes |= _near(addresses, lane, here, size) << (lane - first)
        lane += LANES
    while lane < end:
        lanes |= (1 if 0 <= (addresses[lane] ^ here) < size else 0) << (lane - first)
        lane += 1
    return np.uint64(lanes)


@kernel(lent=True)
def active_lanes(addresses: Any, first: int, end: int) -> Any:
    """Lanes ``first``..``end - 1``, a bit each, whose address is not negative."""
    return lanes_near(addresses, first, end, 0, 2**63 - 1)
