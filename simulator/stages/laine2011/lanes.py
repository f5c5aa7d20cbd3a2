"""Eight pixels of a row, or the four channels of a colour, at once: coverage, depth test, write, mixing.

Each function is plain Python first, so that the kernels also run interpreted; compiled code gets vectors through an
overload.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

LANES = 8
_LOW = 0xFFFFFFFF


def spread(builder: Any, value: Any, vector: Any) -> Any:
    """Take a number, an integer's low bits where it is too wide, to all lanes of a vector."""
    from llvmlite import ir

    nothing, index = ir.Constant(vector, ir.Undefined), ir.IntType(32)
    if value.type != vector.element:
        value = builder.trunc(value, vector.element)
    one = builder.insert_element(nothing, value, ir.Constant(index, 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(index, vector.count), [0] * vector.count))


def from_lane(builder: Any, vector: Any, lane: int, wide: Any) -> Any:
    """Take one lane of a vector to all lanes of another."""
    from llvmlite import ir

    lanes = ir.Constant(ir.VectorType(ir.IntType(32), wide.count), [lane] * wide.count)
    return builder.shuffle_vector(vector, vector, lanes)


def vectors(context: Any, builder: Any, kind: Any, array: Any, at: Any, vector: Any) -> Any:
    """Point to vectors in an array, from its element ``at`` on."""
    data = context.make_array(kind)(context, builder, value=array).data
    return builder.bitcast(data if at is None else builder.gep(data, [at]), vector.as_pointer())


def mixed(colors: Any, corners: Any, weights: Any) -> Any:
    """Colour of three vertices by their weights, eight bits a channel: to nearest, saturating; NaN is 0.

    Parameters
    ----------
    colors : ndarray, (V, 4), float32
    corners : tuple of int
    weights : tuple of float32

    Returns
    -------
    int
        RGBA from the low byte up.
    """
    packed = np.int64(0)
    for c in range(4):
        parts = [weight * colors[corner, c] for corner, weight in zip(corners, weights, strict=True)]
        scaled = np.float64(parts[0] + parts[1] + parts[2]) * 255.0 + 0.5
        packed |= (np.int64(min(scaled, 255.0)) if scaled > 0.0 else 0) << (8 * c)
    return packed


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_mixed(_context: Any, colors: Any, corners: Any, weights: Any) -> Any:
    from llvmlite import ir

    single, double = ir.VectorType(ir.FloatType(), 4), ir.VectorType(ir.DoubleType(), 4)
    whole, byte, word = ir.IntType(32), ir.VectorType(ir.IntType(8), 4), ir.IntType(64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        rows = vectors(context, builder, signature.args[0], args[0], None, single)
        parts = []
        for i in range(3):
            color = builder.load(builder.gep(rows, [builder.extract_value(args[1], i)]), align=4)
            parts.append(builder.fmul(spread(builder, builder.extract_value(args[2], i), single), color))
        value = builder.fpext(builder.fadd(builder.fadd(parts[0], parts[1]), parts[2]), double)
        zero, most = ir.Constant(double, [0.0] * 4), ir.Constant(double, [255.0] * 4)
        scaled = builder.fadd(builder.fmul(value, most), ir.Constant(double, [0.5] * 4))
        scaled = builder.select(builder.fcmp_ordered(">", scaled, zero), scaled, zero)
        scaled = builder.select(builder.fcmp_ordered("<", scaled, most), scaled, most)
        channels = builder.trunc(builder.fptosi(scaled, ir.VectorType(whole, 4)), byte)
        return builder.zext(builder.bitcast(channels, whole), word)

    return types.int64(colors, corners, weights), codegen


@overload(mixed)
def _mixed(colors, corners, weights):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    if colors != types.float32[:, ::1]:
        return None
    return lambda colors, corners, weights: _llvm_mixed(colors, corners, weights)  # noqa: PLW0108 - numba needs a function


def below(first: Any, step: Any, values: Any, at: Any, or_equal: Any) -> Any:
    """Which of eight numbers first, first + step, ... are less than ``values[at]`` and those behind it, as uint32.

    Returns
    -------
    uint64
        Bit i: the i-th is, or, where ``or_equal``, is the same.
    """
    less = [(int(first) + i * int(step)) & _LOW < int(values[at + i]) + bool(or_equal) for i in range(LANES)]
    return np.uint64(sum(1 << i for i, is_less in enumerate(less) if is_less))


def write(first: Any, step: Any, values: Any, at: Any, bits: Any) -> None:
    """Write the numbers first, first + step, ... whose bits are set to ``values[at]`` and behind it."""
    for i in range(LANES):
        if int(bits) >> i & 1:
            values[at + i] = np.int64(first + i * step).astype(values.dtype)


def write_reversed(values: Any, at: Any, target: Any, i: Any) -> None:
    """Write the eight numbers from ``values[at]`` on to ``target[i]`` and behind it, the last one first."""
    target[i : i + LANES] = values[at : at + LANES][::-1]


def _ramp(builder: Any, first: Any, step: Any, vector: Any) -> Any:
    from llvmlite import ir

    steps = builder.mul(spread(builder, step, vector), ir.Constant(vector, list(range(LANES))))
    return builder.add(spread(builder, first, vector), steps)


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_below(_context: Any, first: Any, step: Any, values: Any, at: Any, or_equal: Any) -> Any:
    from llvmlite import ir

    row, flag = ir.VectorType(ir.IntType(32), LANES), ir.VectorType(ir.IntType(1), LANES)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        held = builder.load(vectors(context, builder, signature.args[2], args[2], args[3], row), align=4)
        ramp = _ramp(builder, args[0], args[1], row)
        same = builder.and_(builder.icmp_unsigned("==", ramp, held), spread(builder, args[4], flag))
        found = builder.or_(builder.icmp_unsigned("<", ramp, held), same)
        return builder.zext(builder.bitcast(found, ir.IntType(LANES)), ir.IntType(64))

    return types.uint64(first, step, values, at, or_equal), codegen


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_write(_context: Any, first: Any, step: Any, values: Any, at: Any, bits: Any) -> Any:
    from llvmlite import ir

    row, flag = ir.VectorType(ir.IntType(32), LANES), ir.VectorType(ir.IntType(1), LANES)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = vectors(context, builder, signature.args[2], args[2], args[3], row)
        mask = builder.bitcast(builder.trunc(args[4], ir.IntType(LANES)), flag)
        chosen = builder.select(mask, _ramp(builder, args[0], args[1], row), builder.load(place, align=4))
        builder.store(chosen, place, align=4)
        return context.get_dummy_value()

    return types.void(first, step, values, at, bits), codegen


@overload(below)
def _below(first, step, values, at, or_equal):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda first, step, values, at, or_equal: _llvm_below(first, step, values, at, or_equal)  # noqa: PLW0108 - numba needs a function


@overload(write)
def _write(first, step, values, at, bits):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda first, step, values, at, bits: _llvm_write(first, step, values, at, bits)  # noqa: PLW0108 - as above


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_write_reversed(_context: Any, values: Any, at: Any, target: Any, i: Any) -> Any:
    from llvmlite import ir

    row = ir.VectorType(ir.IntType(32), LANES)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        source, place = (vectors(context, builder, signature.args[k], args[k], args[k + 1], row) for k in (0, 2))
        held = builder.load(source, align=4)
        builder.store(
            builder.shuffle_vector(held, held, ir.Constant(row, list(reversed(range(LANES))))), place, align=4
        )
        return context.get_dummy_value()

    return types.void(values, at, target, i), codegen


@overload(write_reversed)
def _write_reversed(values, at, target, i):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda values, at, target, i: _llvm_write_reversed(values, at, target, i)  # noqa: PLW0108 - as above
