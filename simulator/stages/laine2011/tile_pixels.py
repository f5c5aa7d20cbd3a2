"""Pixels of a tile of 8 x 8 inside a triangle, all at once, as a mask of 64 bits: exact in 1/16 pixel."""

from itertools import pairwise
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

from tilestamp.simulator.stages.laine2011.lanes import from_lane, spread, vectors

_VECTOR = 256  # bits
_NEAR = 1 << 10  # edges that are shorter, in both axes, have steps that 16 bits hold


def inside(header: Any, x: Any, y: Any, margin: Any) -> Any:
    """Pixels whose centre is inside all edges of a triangle, each moved outwards by ``margin`` in both axes.

    Right edges, and upper horizontal ones, are outside themselves.

    Parameters
    ----------
    header : array (6,), int16
        Corners x, y, counter-clockwise, 1/16 pixel.
    x, y, margin : int
        Centre of the tile's lower left pixel, in the same units and within 2**16 of the corners.

    Returns
    -------
    uint64
        Pixel (x, y) at bit 8 * y + 7 - x.
    """
    corners = [(int(header[2 * k]), int(header[2 * k + 1])) for k in (0, 1, 2, 0)]
    edges = [(px, py, qx - px, qy - py) for (px, py), (qx, qy) in pairwise(corners)]
    outer = [margin * (abs(dx) + abs(dy)) - (dy > 0 or (dy == 0 and dx <= 0)) for _, _, dx, dy in edges]

    def covered(i: int, j: int) -> bool:
        values = [(px - x - 16 * i) * dy - (py - y - 16 * j) * dx for px, py, dx, dy in edges]
        return all(value + more >= 0 for value, more in zip(values, outer, strict=True))

    return np.uint64(sum(1 << bit for bit in range(64) if covered(7 - bit % 8, bit // 8)))


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_inside(_context: Any, header: Any, x: Any, y: Any, margin: Any) -> Any:
    from llvmlite import ir

    i16, i32, i64 = ir.IntType(16), ir.IntType(32), ir.IntType(64)
    two, four, whole, long = (ir.VectorType(*of) for of in ((i16, 2), (i16, 4), (i32, 4), (i64, 4)))

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def load(at: int, kind: Any) -> Any:
            place = vectors(context, builder, signature.args[0], args[0], ir.Constant(i64, at), kind)
            return builder.load(place, align=2)

        def pick(*lanes: int) -> Any:
            return builder.sext(builder.shuffle_vector(*halves, ir.Constant(whole, lanes)), whole)

        last = load(4, two)
        halves = load(0, four), builder.shuffle_vector(last, last, ir.Constant(whole, [0, 1, 0, 1]))
        px, py = pick(0, 2, 4, 0), pick(1, 3, 5, 1)
        away = builder.sub(px, spread(builder, args[1], whole)), builder.sub(py, spread(builder, args[2], whole))
        edge = *away, builder.sub(pick(2, 4, 0, 2), px), builder.sub(pick(3, 5, 1, 3), py)
        longest = builder.or_(*(_size(builder, part) for part in edge[2:]))
        near = builder.icmp_unsigned("<", longest, ir.Constant(whole, [_NEAR] * 4))
        near = builder.icmp_unsigned("==", builder.bitcast(near, ir.IntType(4)), ir.Constant(ir.IntType(4), 15))
        with builder.if_else(near) as (then, otherwise):
            with then:
                few, end_of_few = _rows(builder, edge, args[3], whole, i16), builder.block
            with otherwise:
                many, end_of_many = _rows(builder, edge, args[3], long, i32), builder.block
        bits = builder.phi(i64)
        bits.add_incoming(few, end_of_few)
        bits.add_incoming(many, end_of_many)
        return bits

    return types.uint64(header, x, y, margin), codegen


def _size(builder: Any, value: Any) -> Any:
    from llvmlite import ir

    negative = builder.icmp_signed("<", value, ir.Constant(value.type, [0] * value.type.count))
    return builder.select(negative, builder.neg(value), value)


def _rows(builder: Any, edge: Any, margin: Any, long: Any, lane: Any) -> Any:
    """Step three edges over the pixels, in vectors of one row or two.

    Parameters
    ----------
    edge : tuple of vectors of int32
        Of each edge in a lane: its corner less the first pixel, x and y, and its direction.
    margin : int64
    long : vector type
        Holds the edges' values at the first pixel.
    lane : integer type
        Holds a sixteenth of them, as far as a step in the tile can change its sign.
    """
    from llvmlite import ir

    whole, row, word = edge[0].type, ir.VectorType(lane, _VECTOR // lane.width), ir.IntType(64)
    lines = row.count // 8

    def limited(value: Any, operator: str, limit: int) -> Any:
        most = ir.Constant(long, [limit] * 4)
        return builder.select(builder.icmp_signed(operator, value, most), value, most)

    def widened(value: Any) -> Any:
        return value if value.type == long else builder.sext(value, long)

    x, y, dx, dy = edge
    zero = ir.Constant(whole, [0] * 4)
    value = builder.sub(*(builder.mul(widened(a), widened(b)) for a, b in ((x, dy), (y, dx))))
    flat = builder.and_(builder.icmp_signed("==", dy, zero), builder.icmp_signed("<=", dx, zero))
    value = builder.add(value, builder.sext(builder.or_(builder.icmp_signed(">", dy, zero), flat), long))
    size = builder.add(_size(builder, dx), _size(builder, dy))
    value = builder.add(value, widened(builder.mul(size, spread(builder, margin, whole))))
    far = (1 << (lane.width - 2)) - 1
    value = limited(limited(builder.ashr(value, ir.Constant(long, [4] * 4)), "<", far), ">", -far)
    narrow = ir.VectorType(lane, 4)
    steps = [part if part.type == narrow else builder.trunc(part, narrow) for part in (value, dy, dx)]
    edges = [[from_lane(builder, step, k, row) for step in steps] for k in range(3)]
    columns = ir.Constant(row, list(reversed(range(8))) * lines)
    values = [builder.sub(start, builder.mul(right, columns)) for start, right, _ in edges]
    ups = [up for *_, up in edges]
    if lines == 2:
        second = ir.Constant(row, [0] * 8 + [-1] * 8)
        values = [builder.add(value, builder.and_(up, second)) for value, up in zip(values, ups, strict=True)]
        ups = [builder.add(up, up) for up in ups]
    found = []
    for _ in range(8 // lines):
        signs = builder.or_(builder.or_(values[0], values[1]), values[2])
        covered = builder.icmp_signed(">=", signs, ir.Constant(row, [0] * row.count))
        found.append(builder.zext(builder.bitcast(covered, ir.IntType(row.count)), word))
        values = [builder.add(value, up) for value, up in zip(values, ups, strict=True)]
    bits = ir.Constant(word, 0)
    for i, part in [*enumerate(found)][::2] + [*enumerate(found)][1::2]:  # of neighbours LLVM makes slow wide vectors
        bits = builder.or_(bits, builder.shl(part, ir.Constant(word, row.count * i)))
    return bits


@overload(inside)
def _inside(header, x, y, margin):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    return lambda header, x, y, margin: _llvm_inside(header, x, y, margin)  # noqa: PLW0108 - numba needs a function
