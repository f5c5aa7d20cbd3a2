"""Exact signs of edge functions: floating-point expansions (Shewchuk 1997, sections 2 and 3).

A point of the screen lies at homogeneous (x, y, 1), a corner at (x, y, w); the edge function of corners p and q there
is the determinant of the three. It is a sum of six products of three doubles. Each product is split without error into
four doubles, and sums are kept as expansions: non-overlapping doubles that add up to the exact value, whose sign is
that of the largest. No rounding happens anywhere, unless a product leaves the range of a double; corners that were
float32 (times a width below 2**20) cannot make one that does.
"""

from typing import Any

from tilestamp.models.kernel import kernel

COMPONENTS = 32  # six products of four doubles each, and room
_SPLITTER = 134217729.0  # 2**27 + 1
_BOUND = (
    8.0 * 2.0**-53
)  # an edge function is rounded five times, by half a unit in the last place; eight are allowed for


@kernel
def two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """Sum of two doubles, and what rounding took from it (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def two_product(a: Any, b: Any) -> tuple[Any, Any]:
    """Product of two doubles, and what rounding took from it (Dekker)."""
    product = a * b
    big = _SPLITTER * a
    a_high = big - (big - a)
    a_low = a - a_high
    big = _SPLITTER * b
    b_high = big - (big - b)
    b_low = b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@kernel
def _grow(expansion: Any, n: int, b: Any) -> int:
    """Add a double to an expansion of ``n`` components; returns how many there are then."""
    kept = 0
    for i in range(n):
        b, low = two_sum(b, expansion[i])
        if low != 0.0:
            expansion[kept] = low
            kept += 1
    if b != 0.0:
        expansion[kept] = b
        kept += 1
    return kept


@kernel
def _add_product(expansion: Any, n: int, a: Any, b: Any, c: Any) -> int:
    """Add a b c to an expansion."""
    high, low = two_product(a, b)
    for part in (low, high):
        product, rest = two_product(part, c)
        n = _grow(expansion, n, rest)
        n = _grow(expansion, n, product)
    return n


@kernel
def edge_sign(p: Any, q: Any, x: Any, y: Any, w: Any, expansion: Any) -> int:
    """Exact sign, -1, 0 or 1, of det(p, q, (x, y, w)).

    Parameters
    ----------
    p, q : ndarray, (3,), float64
    x, y, w : float
    expansion : ndarray, (COMPONENTS,), float64
        Scratch.
    """
    n = 0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        at = x if k == 0 else y if k == 1 else w
        if at != 0.0:
            n = _add_product(expansion, n, p[i], q[j], at)
            n = _add_product(expansion, n, -p[j], q[i], at)
    return 0 if n == 0 else 1 if expansion[n - 1] > 0.0 else -1


@kernel
def edge_function(p: Any, q: Any, edge: Any) -> None:
    """Coefficients of x, y and w of det(p, q, (x, y, w)) in double precision, and of its error bound, to ``edge`` (6,).

    The rounded value is within edge[3] |x| + edge[4] |y| + edge[5] |w| of the exact one.
    """
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        edge[k] = p[i] * q[j] - p[j] * q[i]
        edge[3 + k] = _BOUND * (abs(p[i] * q[j]) + abs(p[j] * q[i]))


@kernel
def sure_sign(edge: Any, p: Any, q: Any, x: Any, y: Any, w: Any, expansion: Any) -> Any:
    """Exact sign of det(p, q, (x, y, w)): by the rounded ``edge`` where its bound allows, by expansions elsewhere."""
    value = edge[0] * x + edge[1] * y + edge[2] * w
    bound = edge[3] * abs(x) + edge[4] * abs(y) + edge[5] * abs(w)
    if abs(value) > bound:
        return 1 if value > 0.0 else -1
    return edge_sign(p, q, x, y, w, expansion)
