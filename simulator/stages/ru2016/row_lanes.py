"""Eight pixels of a row at once: which lie in a triangle, and where it is nearer.

Each function is plain Python first, so that the kernel also runs interpreted; compiled code gets vectors through an
overload.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

from tilestamp.simulator.stages.laine2011.lanes import LANES, spread, vectors
from tilestamp.simulator.stages.ru2016.triangle import barycentric, inside

_HALF = np.float32(0.5)


def eight_inside(triangle: Any, x: Any, py: Any) -> Any:
    """Which of the eight pixels from column ``x`` on lie in a triangle.

    Parameters
    ----------
    triangle : tuple
        Its corners, as ``triangle.corners`` gives them, one over its area, and the depths of its corners; float32.
    x : int
    py : float32
        Height of the samples.

    Returns
    -------
    uint64
        Bit i: pixel x + i.
    """
    corners, inverse, _ = triangle
    lie = [inside(*barycentric(*corners, inverse, np.float32(x + i) + _HALF, py)) for i in range(LANES)]
    return np.uint64(sum(int(is_in) << i for i, is_in in enumerate(lie)))


def write_nearer(triangle: Any, x: Any, y: Any, py: Any, bits: Any, t: Any, depth: Any, drawn: Any) -> Any:
    """Write a triangle and its depth where it is nearer than what is there, and not before the screen.

    Parameters
    ----------
    triangle, x, py
        As above.
    y : int
    bits : uint64
        Bit i: whether pixel x + i is to be looked at.
    t : int
    depth : ndarray, (H, W), float32
    drawn : ndarray, (H, W), int32
        Triangle of each pixel.

    Returns
    -------
    uint64
        Bit i: whether pixel x + i was written.
    """
    (corners, inverse, depths), written = triangle, 0
    for i in range(LANES):
        if not int(bits) >> i & 1:
            continue
        a, b, c = barycentric(*corners, inverse, np.float32(x + i) + _HALF, py)
        z = a * depths[0] + b * depths[1] + c * depths[2]
        if z >= 0 and z < depth[y, x + i]:
            depth[y, x + i], drawn[y, x + i] = z, t
            written |= 1 << i
    return np.uint64(written)


def _weights(builder: Any, triangle: Any, x: Any, py: Any) -> Any:
    """Barycentric coordinates of eight pixels, in the order of operations of ``triangle.barycentric``."""
    from llvmlite import ir

    row, whole = ir.VectorType(ir.FloatType(), LANES), ir.VectorType(ir.IntType(32), LANES)
    x0, y0, x1, y1, x2, y2 = (builder.extract_value(triangle, [0, i]) for i in range(6))
    columns = builder.add(spread(builder, x, whole), ir.Constant(whole, list(range(LANES))))
    px = builder.fadd(builder.sitofp(columns, row), ir.Constant(row, [0.5] * LANES))
    right, down = builder.fsub(px, spread(builder, x0, row)), builder.fsub(py, y0)

    def across(start: Any, end: Any) -> Any:
        return builder.fmul(right, spread(builder, builder.fsub(start, end), row))

    def along(start: Any, end: Any) -> Any:
        return spread(builder, builder.fmul(builder.fsub(start, end), down), row)

    scale = spread(builder, builder.extract_value(triangle, 1), row)
    b = builder.fmul(builder.fsub(along(x2, x0), across(y2, y0)), scale)
    c = builder.fmul(builder.fsub(across(y1, y0), along(x1, x0)), scale)
    return builder.fsub(builder.fsub(ir.Constant(row, [1.0] * LANES), b), c), b, c


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_eight_inside(_context: Any, triangle: Any, x: Any, py: Any) -> Any:
    from llvmlite import ir

    row = ir.VectorType(ir.FloatType(), LANES)

    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        bits = ir.Constant(ir.VectorType(ir.IntType(1), LANES), [1] * LANES)
        for weight in _weights(builder, *args):
            for sign, bound in ((">=", 0.0), ("<=", 1.0)):
                bits = builder.and_(bits, builder.fcmp_ordered(sign, weight, ir.Constant(row, [bound] * LANES)))
        return builder.zext(builder.bitcast(bits, ir.IntType(LANES)), ir.IntType(64))

    return types.uint64(triangle, x, py), codegen


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_write_nearer(
    _context: Any, triangle: Any, x: Any, y: Any, py: Any, bits: Any, t: Any, depth: Any, drawn: Any
) -> Any:
    from llvmlite import ir

    row, whole = ir.VectorType(ir.FloatType(), LANES), ir.VectorType(ir.IntType(32), LANES)
    flags, align, nothing = ir.VectorType(ir.IntType(1), LANES), ir.IntType(32)(4), ir.VoidType()

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        triangle, x, y, py, bits, t, depth, drawn = args
        z0, z1, z2 = (spread(builder, builder.extract_value(triangle, [2, i]), row) for i in range(3))
        a, b, c = _weights(builder, triangle, x, py)
        z = builder.fadd(builder.fadd(builder.fmul(a, z0), builder.fmul(b, z1)), builder.fmul(c, z2))
        buffer = context.make_array(signature.args[6])(context, builder, value=depth)
        width = builder.extract_value(buffer.shape, 1)
        at = builder.add(builder.mul(y, width), x)
        far = vectors(context, builder, signature.args[6], depth, at, row)
        names = vectors(context, builder, signature.args[7], drawn, at, whole)

        def masked(name: str, result: Any, *values: Any) -> Any:
            kind = ir.FunctionType(result, [value.type for value in values])
            return builder.call(builder.module.declare_intrinsic(name, (), kind), values)

        lanes = builder.bitcast(builder.trunc(bits, ir.IntType(LANES)), flags)
        held = masked("llvm.masked.load.v8f32.p0", row, far, align, lanes, ir.Constant(row, [0.0] * LANES))
        before = builder.fcmp_ordered(">=", z, ir.Constant(row, [0.0] * LANES))
        nearer = builder.and_(builder.and_(lanes, before), builder.fcmp_ordered("<", z, held))
        masked("llvm.masked.store.v8f32.p0", nothing, z, far, align, nearer)
        masked("llvm.masked.store.v8i32.p0", nothing, spread(builder, t, whole), names, align, nearer)
        return builder.zext(builder.bitcast(nearer, ir.IntType(LANES)), ir.IntType(64))

    return types.uint64(triangle, x, y, py, bits, t, depth, drawn), codegen


@overload(eight_inside)
def _eight_inside(triangle, x, py):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda triangle, x, py: _llvm_eight_inside(triangle, x, py)  # noqa: PLW0108 - numba needs a function


@overload(write_nearer)
def _write_nearer(triangle, x, y, py, bits, t, depth, drawn):  # type: ignore[no-untyped-def]  # noqa: ARG001 - as above
    call = _llvm_write_nearer
    return lambda triangle, x, y, py, bits, t, depth, drawn: call(triangle, x, y, py, bits, t, depth, drawn)  # noqa: PLW0108
