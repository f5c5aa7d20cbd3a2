"""Coverage of a tile by three edge functions in float32, stepped pixel by pixel.

Plain Python first, so that the kernel also runs interpreted; compiled code steps eight columns at once.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

SIDE = 8  # pixels


def stepped_tile(a: Any, b: Any, c: Any) -> Any:
    """Pixels of a tile at which none of three edge functions is negative, as a uint64.

    Parameters
    ----------
    a, b, c : tuple of float32
        Of each edge: its value at the left lower pixel, what a step right adds, and what a step up adds.

    Returns
    -------
    uint64
        Pixel (x, y) at bit 8 * y + x. The lowest row is stepped from the left, and each column up by itself.
    """
    bits = 0
    starts = [edge[0] for edge in (a, b, c)]
    for x in range(SIDE):
        values = list(starts)
        for y in range(SIDE):
            bits |= int(all(value >= 0 for value in values)) << (SIDE * y + x)
            values = [value + edge[2] for value, edge in zip(values, (a, b, c), strict=True)]
        starts = [value + edge[1] for value, edge in zip(starts, (a, b, c), strict=True)]
    return np.uint64(bits)


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_stepped_tile(_context: Any, a: Any, b: Any, c: Any) -> Any:
    from llvmlite import ir

    index, word, row = ir.IntType(32), ir.IntType(64), ir.VectorType(ir.FloatType(), SIDE)

    def codegen(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        edges = [[builder.extract_value(edge, i) for i in range(3)] for edge in args]
        values, ups = [], []
        for value, right, up in edges:
            columns = every_up = ir.Constant(row, ir.Undefined)
            for x in range(SIDE):
                columns = builder.insert_element(columns, value, ir.Constant(index, x))
                every_up = builder.insert_element(every_up, up, ir.Constant(index, x))
                value = builder.fadd(value, right)  # noqa: PLW2901 - of the next column
            values.append(columns)
            ups.append(every_up)
        bits = ir.Constant(word, 0)
        for y in range(SIDE):
            inside = [builder.fcmp_ordered(">=", value, ir.Constant(row, [0.0] * SIDE)) for value in values]
            eight = builder.bitcast(builder.and_(builder.and_(inside[0], inside[1]), inside[2]), ir.IntType(SIDE))
            bits = builder.or_(bits, builder.shl(builder.zext(eight, word), ir.Constant(word, SIDE * y)))
            values = [builder.fadd(value, up) for value, up in zip(values, ups, strict=True)]
        return bits

    return types.uint64(a, b, c), codegen


@overload(stepped_tile)
def _stepped_tile(a, b, c):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda a, b, c: _llvm_stepped_tile(a, b, c)  # noqa: PLW0108 - numba needs a function
