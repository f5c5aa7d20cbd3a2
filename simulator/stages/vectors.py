"""Sixteen numbers at once, in one register: a lane a vertex of a grid, or a control point of a patch.

A lane does what a thread would. Kernels add, multiply and compare vectors as they do numbers, each lane rounded by
itself; a number beside a vector stands for sixteen of it. Each function is plain Python first, where a vector is an
array, so that the kernels also run interpreted; compiled code has a type of its own for vectors.
"""

import operator
from collections.abc import Callable
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.typing import signature
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import lower_builtin, models, register_model

COUNT = 16
SIDE = 4  # lanes of a row of a grid
Vector = Any


def load(array: Any, at: Any) -> Vector:
    """Sixteen numbers of a flat array."""
    return array[at : at + COUNT].copy()


def load_rows(array: Any, at: Any) -> Any:
    """Four vectors: row k of a 4x4 matrix in each row of a grid."""
    return tuple(np.tile(array[at + SIDE * k : at + SIDE * (k + 1)], SIDE) for k in range(SIDE))


def load_vertices(array: Any, at: Any) -> Any:
    """Four vectors: each coordinate of sixteen vertices, one after another in a flat array."""
    return tuple(array[at + k : at + SIDE * COUNT : SIDE].copy() for k in range(SIDE))


def gather(array: Any, places: Any, at: Any, further: int) -> Vector:
    """Sixteen numbers of a flat array, each four times its one of the uint64 ``places[at:]`` and ``further`` behind."""
    return array[SIDE * places[at : at + COUNT].astype(np.int64) + further]


def store(array: Any, at: Any, vector: Vector) -> None:
    """Write sixteen numbers to a flat array."""
    array[at : at + COUNT] = vector


def store_vertices(array: Any, at: Any, coordinates: Any) -> None:
    """Write sixteen vertices to a flat array; of each coordinate a vector."""
    for k in range(SIDE):
        array[at + k : at + SIDE * COUNT : SIDE] = coordinates[k]


def columns(vector: Vector) -> Any:
    """Four vectors: column k of a grid in all its columns."""
    return tuple(np.repeat(vector[k::SIDE], SIDE) for k in range(SIDE))


def spread(number: Any) -> Vector:
    """Sixteen times a number."""
    return np.full(COUNT, number, np.float32)


def select(mask: Any, yes: Any, no: Any) -> Vector:
    """Lanes of ``yes`` where the mask is set, else of ``no``."""
    return np.where(mask, yes, no).astype(np.float32)


def smaller(a: Any, b: Any) -> Vector:
    """Lane by lane ``min(a, b)``: ``a`` where they do not compare."""
    return select(b < a, b, a)


def larger(a: Any, b: Any) -> Vector:
    """Lane by lane ``max(a, b)``: ``a`` where they do not compare."""
    return select(b > a, b, a)


def floor(vector: Vector) -> Vector:
    """Round down."""
    return np.floor(vector)


def ceil(vector: Vector) -> Vector:
    """Round up."""
    return np.ceil(vector)


def size(vector: Vector) -> Vector:
    """Absolute value."""
    return abs(vector)


def root(vector: Vector) -> Vector:
    """Square root."""
    return np.sqrt(vector)


def first(vector: Vector) -> Any:
    """The number in the first lane."""
    return vector[0]


def least(vector: Vector, start: Any) -> Any:
    """The least number; ``start`` where a lane is no number, or none is less."""
    return min([start, *vector])


def greatest(vector: Vector, start: Any) -> Any:
    """The greatest number; ``start`` where a lane is no number, or none is greater."""
    return max([start, *vector])


def bits(mask: Any) -> Any:
    """Bit i of a uint64: whether lane i of the mask is set."""
    return np.uint64(sum(1 << lane for lane in range(COUNT) if mask[lane]))


def rgba(red: Vector, green: Vector, blue: Vector) -> Vector:
    """Opaque colours of levels from 0 to 255, rounded down: RGBA8, red lowest, in the bits of a float32."""
    channels = [channel.astype(np.uint32) << np.uint32(8 * k) for k, channel in enumerate((red, green, blue))]
    return (channels[0] | channels[1] | channels[2] | np.uint32(0xFF000000)).view(np.float32)


class Lanes(types.Type):  # type: ignore[misc]
    """Type of a vector, by that of a lane; its name tells kernels apart that other code here would compile."""

    def __init__(self, lane: Any) -> None:
        super().__init__(f"{COUNT} lanes of {lane} {sha256(Path(__file__).read_bytes()).hexdigest()[:24]}")


_NUMBERS, _MASK = Lanes(types.float32), Lanes(types.boolean)
_FOUR = types.UniTuple(_NUMBERS, SIDE)


@register_model(Lanes)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, _kind("bit" if kind == _MASK else "float"))


def _kind(lane: str = "float", lanes: int = COUNT) -> Any:
    """Vector of LLVM."""
    from llvmlite import ir

    return ir.VectorType({"float": ir.FloatType(), "bit": ir.IntType(1), "word": ir.IntType(32)}[lane], lanes)


def _compile(function: Any, returned: Any, *wanted: Any) -> Callable[[Callable[..., Any]], None]:
    """Give a function its compiled form, ``code(builder, *values)``; ``wanted`` are types, or classes of them.

    Where a vector is wanted, a float32 is taken to all lanes; an array comes as the address of its data, and a tuple
    as a list.
    """

    class Template(AbstractTemplate):  # type: ignore[misc]
        key = function

        def generic(self, given: Any, _keywords: Any) -> Any:
            fits = len(given) == len(wanted) and all(map(_fits, given, wanted))
            vectors = any(isinstance(kind, (Lanes, types.UniTuple)) for kind in (returned, *given))
            return signature(returned, *given) if fits and (vectors or function is spread) else None

    def register(code: Callable[..., Any]) -> None:
        def lowered(context: Any, builder: Any, found: Any, values: Any) -> Any:
            arguments = zip(values, found.args, wanted, strict=True)
            result = code(builder, *[_value(context, builder, *argument) for argument in arguments])
            if returned == _FOUR:
                return context.make_tuple(builder, returned, result)
            return context.get_dummy_value() if returned == types.void else result

        infer_global(function)(Template)
        for kinds in product(*[(Lanes, types.Float) if kind == _NUMBERS else (kind,) for kind in wanted]):
            if function is spread or set(kinds) != {types.Float}:  # what numbers do is Numba's
                lower_builtin(function, *kinds)(lowered)

    return register


def _fits(given: Any, wanted: Any) -> bool:
    if isinstance(wanted, type):
        return isinstance(given, wanted)
    return bool(given == wanted or (wanted == _NUMBERS and given == types.float32))


def _value(context: Any, builder: Any, value: Any, given: Any, wanted: Any) -> Any:
    """What compiled code gets of an argument."""
    if isinstance(given, types.Array):
        return context.make_array(given)(context, builder, value=value).data
    if isinstance(given, types.BaseTuple):
        return cgutils.unpack_tuple(builder, value)
    return _spread(builder, value) if wanted == _NUMBERS and given == types.float32 else value


def _shuffle(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    from llvmlite import ir

    return builder.shuffle_vector(a, b, ir.Constant(_kind("word", len(lanes)), lanes))


def _spread(builder: Any, number: Any) -> Any:
    from llvmlite import ir

    nothing = ir.Constant(_kind(), ir.Undefined)
    return _shuffle(
        builder, builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0)), nothing, [0] * COUNT
    )


def _place(builder: Any, data: Any, at: Any, further: int, lanes: int = COUNT) -> Any:
    """Address of some lanes in an array."""
    from llvmlite import ir

    place = builder.gep(builder.gep(data, [at]), [ir.Constant(ir.IntType(64), further)])
    return builder.bitcast(place, _kind(lanes=lanes).as_pointer())


def _method(name: str, *options: str) -> Callable[..., Any]:
    """Code of one instruction."""
    return lambda builder, *values: getattr(builder, name)(*options, *values)


for _operator, _code in (
    (operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"),
):  # fmt: skip
    _compile(_operator, _NUMBERS, _NUMBERS, _NUMBERS)(_method(_code))
for _operator, _code in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _compile(_operator, _MASK, _NUMBERS, _NUMBERS)(_method("fcmp_ordered", _code))
_compile(operator.ne, _MASK, _NUMBERS, _NUMBERS)(_method("fcmp_unordered", "!="))
_compile(operator.eq, _MASK, _MASK, _MASK)(_method("icmp_signed", "=="))
_compile(operator.and_, _MASK, _MASK, _MASK)(_method("and_"))
_compile(operator.or_, _MASK, _MASK, _MASK)(_method("or_"))
_compile(operator.invert, _MASK, _MASK)(_method("not_"))
_compile(operator.neg, _NUMBERS, _NUMBERS)(_method("fneg"))
_compile(spread, _NUMBERS, _NUMBERS)(lambda _builder, vector: vector)
_compile(select, _NUMBERS, _MASK, _NUMBERS, _NUMBERS)(_method("select"))


def _library(name: str) -> Callable[..., Any]:
    """Code of a function that LLVM knows."""

    def code(builder: Any, vector: Any) -> Any:
        from llvmlite import ir

        kind = ir.FunctionType(_kind(), [_kind()])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{COUNT}f32"), [vector])

    return code


for _function, _code in ((floor, "floor"), (ceil, "ceil"), (root, "sqrt"), (size, "fabs")):
    _compile(_function, _NUMBERS, _NUMBERS)(_library(_code))


def _chosen(builder: Any, compare: str, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(compare, b, a), b, a)


_compile(smaller, _NUMBERS, _NUMBERS, _NUMBERS)(lambda builder, a, b: _chosen(builder, "<", a, b))
_compile(larger, _NUMBERS, _NUMBERS, _NUMBERS)(lambda builder, a, b: _chosen(builder, ">", a, b))


def _folded(compare: str) -> Callable[..., Any]:
    def code(builder: Any, vector: Any, start: Any) -> Any:
        vector = _chosen(builder, compare, start, vector)  # so that all lanes compare, or none
        for further in (8, 4, 2, 1):
            lanes = [(lane + further) % COUNT for lane in range(COUNT)]
            vector = _chosen(builder, compare, vector, _shuffle(builder, vector, vector, lanes))
        return _first(builder, vector)

    return code


def _first(builder: Any, vector: Any) -> Any:
    from llvmlite import ir

    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


_compile(first, types.float32, _NUMBERS)(_first)
_compile(least, types.float32, _NUMBERS, _NUMBERS)(_folded("<"))
_compile(greatest, types.float32, _NUMBERS, _NUMBERS)(_folded(">"))


@_compile(bits, types.uint64, _MASK)
def _bits(builder: Any, mask: Any) -> Any:
    from llvmlite import ir

    return builder.zext(builder.bitcast(mask, ir.IntType(COUNT)), ir.IntType(64))


@_compile(load, _NUMBERS, types.Array, types.Integer)
def _load(builder: Any, data: Any, at: Any) -> Any:
    return builder.load(_place(builder, data, at, 0), align=4)


@_compile(gather, _NUMBERS, types.Array, types.Array, types.Integer, types.Integer)
def _gather(builder: Any, data: Any, places: Any, at: Any, further: Any) -> Any:
    from llvmlite import ir

    long, vector = ir.IntType(64), ir.Constant(_kind(), ir.Undefined)
    for lane in range(COUNT):
        place = builder.load(builder.gep(places, [builder.add(at, ir.Constant(long, lane))]))
        place = builder.add(builder.shl(place, ir.Constant(long, 2)), further)
        number = builder.load(builder.gep(data, [place]))
        vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), lane))
    return vector


@_compile(store, types.void, types.Array, types.Integer, _NUMBERS)
def _store(builder: Any, data: Any, at: Any, vector: Any) -> None:
    builder.store(vector, _place(builder, data, at, 0), align=4)


@_compile(load_rows, _FOUR, types.Array, types.Integer)
def _load_rows(builder: Any, data: Any, at: Any) -> Any:
    rows = [builder.load(_place(builder, data, at, SIDE * k, SIDE), align=4) for k in range(SIDE)]
    return [_shuffle(builder, row, row, [*range(SIDE)] * SIDE) for row in rows]


@_compile(columns, _FOUR, _NUMBERS)
def _columns(builder: Any, vector: Any) -> Any:
    return [_shuffle(builder, vector, vector, [lane // SIDE * SIDE + k for lane in range(COUNT)]) for k in range(SIDE)]


@_compile(load_vertices, _FOUR, types.Array, types.Integer)
def _load_vertices(builder: Any, data: Any, at: Any) -> Any:
    rows = [builder.load(_place(builder, data, at, COUNT * k), align=4) for k in range(SIDE)]
    low, high = (_shuffle(builder, rows[k], rows[k + 1], [*range(2 * COUNT)]) for k in (0, 2))
    return [_shuffle(builder, low, high, [SIDE * vertex + k for vertex in range(COUNT)]) for k in range(SIDE)]


@_compile(store_vertices, types.void, types.Array, types.Integer, types.BaseTuple)
def _store_vertices(builder: Any, data: Any, at: Any, coordinates: Any) -> None:
    low, high = (_shuffle(builder, coordinates[k], coordinates[k + 1], [*range(2 * COUNT)]) for k in (0, 2))
    lanes = [k * COUNT + vertex for vertex in range(COUNT) for k in range(SIDE)]
    for k in range(0, SIDE * COUNT, COUNT):
        builder.store(_shuffle(builder, low, high, lanes[k : k + COUNT]), _place(builder, data, at, k), align=4)


@_compile(rgba, _NUMBERS, _NUMBERS, _NUMBERS, _NUMBERS)
def _rgba(builder: Any, *channels: Any) -> Any:
    from llvmlite import ir

    packed, word = ir.Constant(_kind("word"), [0xFF000000] * COUNT), _kind("word")
    for k, channel in enumerate(channels):
        shifted = builder.shl(builder.fptoui(channel, word), ir.Constant(word, [8 * k] * COUNT))
        packed = builder.or_(packed, shifted)
    return builder.bitcast(packed, _kind())
