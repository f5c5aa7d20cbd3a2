"""One list entry at 32 pixels: what the blending loop does in one step of a warp, or in half of one of 64 lanes.

Plain Python first, so that kernels also run interpreted; compiled code gets vectors of 32 floats. Both do the same
operations in float32, with the fused multiply-adds of the compiled original and the exp of its GPU.
"""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from tilestamp.simulator.stages.kerbl2023.exponential import (
    ADDED,
    BITS,
    CONSTANTS,
    LEAST,
    LINEAR,
    LOG2_E,
    LOG2_E_LOW,
    LOW_BITS,
    PER_252,
    SQUARE,
    STEPS,
    WHOLE_AT_0,
    X_BITS,
    exp32,
)
from tilestamp.simulator.stages.laine2011.exact import fma

LANES = 32
X, Y, TRANSMITTANCE, RED, GREEN, BLUE, LAST, ROWS = range(8)  # rows of the state; LAST holds an integer's bits
GX, GY, A, B, C, OPACITY, ENTRY_RED, ENTRY_GREEN, ENTRY_BLUE, LEAST_ENTRY_POWER, ENTRY = range(11)  # of an entry
MOST_ALPHA, LEAST_ALPHA, OPAQUE = np.float32(0.99), np.float32(1) / np.float32(255), np.float32(0.0001)


def blend_step(state: Any, lasts: Any, first: int, alive: Any, entry: Any, number: int) -> Any:
    """Evaluate an entry at the pixels that are not done, and blend it where it is seen.

    Parameters
    ----------
    state : ndarray, (ROWS, lanes), float32
        Of the pixels: coordinates, transmittance, colour.
    lasts : ndarray, (ROWS, lanes), int32
        The same memory; row LAST gets ``number`` where a pixel blends.
    first : int
        First lane.
    alive : uint32
        Pixels that are not done, a bit each.
    entry : ndarray, (ENTRY,), float32
        Position, conic, opacity, colour, and a power below which alpha is known to be too small.
    number : int
        Of the entry in its list, from 1.

    Returns
    -------
    blended, stopped, unbounded : uint32
        A bit for each pixel that blends, that would grow opaque and is done, and whose power is positive.
    """
    blended = stopped = unbounded = 0
    for lane in range(LANES):
        if not (int(alive) >> lane) & 1:
            continue
        at = first + lane
        dx, dy = entry[GX] - state[X, at], entry[GY] - state[Y, at]
        power = fma(fma(dx, dx * entry[A], dy * (dy * entry[C])), np.float32(-0.5), -(dy * (dx * entry[B])))
        if power > 0:
            unbounded |= 1 << lane
            continue
        product = entry[OPACITY] * exp32(power)
        alpha = min(MOST_ALPHA, product)
        if alpha < LEAST_ALPHA:
            continue
        left = state[TRANSMITTANCE, at] * (np.float32(1) - alpha)
        if left < OPAQUE:
            stopped |= 1 << lane
            continue
        for row in range(3):
            state[RED + row, at] = fma(state[TRANSMITTANCE, at], alpha * entry[ENTRY_RED + row], state[RED + row, at])
        state[TRANSMITTANCE, at] = left
        lasts[LAST, at] = number
        blended |= 1 << lane
    return blended, stopped, unbounded


class _Vector:
    """Builds vector code: constants of all lanes, fused multiply-adds, bits of a comparison."""

    def __init__(self, builder: Any) -> None:
        from llvmlite import ir

        self.ir, self.builder = ir, builder
        self.floats = ir.VectorType(ir.FloatType(), LANES)
        self.ints = ir.VectorType(ir.IntType(32), LANES)

    def all(self, value: Any, kind: Any) -> Any:
        """A constant in all lanes."""
        return self.ir.Constant(kind, [value] * LANES)

    def spread(self, value: Any, kind: Any) -> Any:
        """A scalar in all lanes."""
        ir, empty = self.ir, self.ir.Constant(kind, self.ir.Undefined)
        one = self.builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self.builder.shuffle_vector(one, empty, zeros)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        """One rounding."""
        kind = self.ir.FunctionType(self.floats, [self.floats] * 3)
        found = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.fma.v{LANES}f32")
        return self.builder.call(found, [a, b, c])

    def exp(self, power: Any) -> Any:
        """As ``exp32``; NaN as of LEAST."""
        b, floats, ints = self.builder, self.floats, self.ints
        low = self.all(float(LEAST), floats)
        power = b.select(b.fcmp_ordered(">=", power, low), power, low)
        share = self.fma(power, self.all(float(PER_252), floats), self.all(0.5, floats))
        steps = self.all(float(STEPS), floats)
        whole = b.fptosi(b.fmul(share, steps), ints)  # rounded to the nearest, it may be one too many
        over = b.fcmp_ordered("<", self.fma(share, steps, b.fneg(b.sitofp(whole, floats))), self.all(0.0, floats))
        whole = b.add(whole, b.sext(over, ints))
        start = b.sitofp(b.sub(self.all(WHOLE_AT_0, ints), whole), floats)
        rest = self.fma(power, self.all(float(LOG2_E), floats), start)
        rest = self.fma(power, self.all(float(LOG2_E_LOW), floats), rest)
        fixed = b.fptosi(b.fmul(rest, self.all(2.0**BITS, floats)), ints)
        return b.bitcast(self._power_of_2(b.add(fixed, b.ashr(fixed, self.all(31, ints))), whole), floats)

    def _power_of_2(self, fixed: Any, whole: Any) -> Any:
        """Bits of the float; in 32-bit sums: of the total, what lies below bit 9 and above is added up apart."""
        b, ints = self.builder, self.ints
        row = b.and_(b.lshr(fixed, self.all(X_BITS, ints)), self.all(63, ints))
        high = b.and_(b.lshr(fixed, self.all(LOW_BITS, ints)), self.all((1 << X_BITS - LOW_BITS) - 1, ints))
        low = b.and_(fixed, self.all((1 << LOW_BITS) - 1, ints))
        odd = b.and_(high, self.all(1, ints))
        square = b.lshr(b.sub(b.mul(high, high), odd), self.all(1, ints))
        none = self.all(0, ints)
        for k in range(1, X_BITS - LOW_BITS):
            counts = b.icmp_unsigned("!=", b.and_(high, self.all(1 << k, ints)), none)
            square = b.add(square, b.select(counts, b.lshr(low, self.all(LOW_BITS - k, ints)), none))
        constant = self.look_up("constants", [8 * value + (ADDED >> LOW_BITS) for value in CONSTANTS], row)
        both = self.look_up("slopes", [a | b << 16 for a, b in zip(LINEAR, SQUARE, strict=True)], row)
        linear, quadratic = b.and_(both, self.all(65535, ints)), b.lshr(both, self.all(16, ints))
        below = b.add(b.mul(linear, low), b.mul(quadratic, square))
        below = b.lshr(b.add(below, self.all(ADDED & (1 << LOW_BITS) - 1, ints)), self.all(LOW_BITS, ints))
        total = b.add(b.add(constant, b.mul(linear, high)), below)
        exponent = b.add(b.ashr(fixed, self.all(BITS, ints)), whole)
        return b.add(b.lshr(total, self.all(6, ints)), b.shl(exponent, self.all(BITS, ints)))

    def look_up(self, name: str, values: list[int], row: Any) -> Any:
        """Gather a value a lane from a table of 64."""
        ir, b, ints = self.ir, self.builder, self.ints
        table = ir.Constant(ir.ArrayType(ir.IntType(32), len(values)), values)
        place = cgutils.global_constant(b, f"splat_{name}", table)
        start = b.bitcast(place, ir.IntType(32).as_pointer())
        places = b.gep(start, [ir.Constant(ir.IntType(32), 0)])  # the builder knows no vectors of places
        places.indices, places.operands, places.type = [row], [start, row], ir.VectorType(start.type, LANES)
        bits = ir.VectorType(ir.IntType(1), LANES)
        kind = ir.FunctionType(ints, [places.type, ir.IntType(32), bits, ints])
        gather = cgutils.get_or_insert_function(b.module, kind, f"llvm.masked.gather.v{LANES}i32.v{LANES}p0")
        return b.call(gather, [places, ir.Constant(ir.IntType(32), 4), self.all(1, bits), self.all(0, ints)])


def _step(builder: Any, base: Any, stride: Any, alive: Any, entry: Any, number: Any) -> Any:
    """Vector code of ``blend_step``; ``base`` is a pointer to the first lane's X, rows lie ``stride`` bytes apart."""
    v = _Vector(builder)
    ir, b, floats = v.ir, builder, v.floats
    word, byte = ir.IntType(32), ir.IntType(8)
    bits = ir.VectorType(ir.IntType(1), LANES)

    def place(row: int, kind: Any = floats) -> Any:
        offset = b.mul(stride, ir.Constant(stride.type, row))
        return b.bitcast(b.gep(b.bitcast(base, byte.as_pointer()), [offset]), kind.as_pointer())

    def load(row: int) -> Any:
        return b.load(place(row), align=4)

    e = [v.spread(part, floats) for part in entry]
    dx, dy = b.fsub(e[GX], load(X)), b.fsub(e[GY], load(Y))
    inner = v.fma(dx, b.fmul(dx, e[A]), b.fmul(dy, b.fmul(dy, e[C])))
    power = v.fma(inner, v.all(-0.5, floats), b.fneg(b.fmul(dy, b.fmul(dx, e[B]))))
    living = b.bitcast(alive, bits)
    bounded = b.fcmp_unordered("<=", power, v.all(0.0, floats))
    near = b.and_(living, b.and_(bounded, b.fcmp_unordered(">=", power, e[LEAST_ENTRY_POWER])))
    unbounded = b.bitcast(b.and_(living, b.not_(bounded)), word)
    results = [cgutils.alloca_once_value(b, ir.Constant(word, 0)) for _ in range(2)]
    with b.if_then(b.icmp_unsigned("!=", b.bitcast(near, word), ir.Constant(word, 0))):
        product, most = b.fmul(e[OPACITY], v.exp(power)), v.all(float(MOST_ALPHA), floats)
        alpha = b.select(b.fcmp_ordered("<", product, most), product, most)
        alpha = b.select(b.fcmp_unordered("uno", power, power), most, alpha)
        seen = b.and_(near, b.fcmp_unordered(">=", alpha, v.all(float(LEAST_ALPHA), floats)))
        before = load(TRANSMITTANCE)
        left = b.fmul(before, b.fsub(v.all(1.0, floats), alpha))
        ends = b.and_(seen, b.fcmp_ordered("<", left, v.all(float(OPAQUE), floats)))
        blends = b.and_(seen, b.not_(ends))
        b.store(b.bitcast(blends, word), results[0])
        b.store(b.bitcast(ends, word), results[1])
        with b.if_then(b.icmp_unsigned("!=", b.bitcast(blends, word), ir.Constant(word, 0))):
            for k in range(3):
                old = load(RED + k)
                new = v.fma(before, b.fmul(alpha, e[ENTRY_RED + k]), old)
                b.store(b.select(blends, new, old), place(RED + k), align=4)
            b.store(b.select(blends, left, before), place(TRANSMITTANCE), align=4)
            whole = ir.VectorType(word, LANES)
            old = b.load(place(LAST, whole), align=4)
            b.store(b.select(blends, v.spread(number, whole), old), place(LAST, whole), align=4)
    return b.load(results[0]), b.load(results[1]), unbounded


@intrinsic  # type: ignore[untyped-decorator]
def _llvm_step(_context: Any, state: Any, first: Any, alive: Any, entry: Any, number: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kinds = signature.args
        array = context.make_array(kinds[0])(context, builder, args[0])
        base = builder.gep(array.data, [args[1]])
        stride = cgutils.unpack_tuple(builder, array.strides)[0]
        row = context.make_array(kinds[3])(context, builder, args[3])
        parts = [builder.load(builder.gep(row.data, [context.get_constant(types.intp, k)])) for k in range(ENTRY)]
        found = _step(builder, base, stride, args[2], parts, args[4])
        return context.make_tuple(builder, signature.return_type, found)

    kind = types.UniTuple(types.uint32, 3)
    return kind(state, first, alive, entry, number), codegen


@overload(blend_step)
def _blend_step(state, lasts, first, alive, entry, number):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares signatures
    def compiled(state, lasts, first, alive, entry, number):  # type: ignore[no-untyped-def]  # noqa: ARG001 - as above
        return _llvm_step(state, np.intp(first), np.uint32(alive), entry, np.int32(number))

    return compiled
