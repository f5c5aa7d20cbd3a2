"""Mutants: one small wrong change each, of a rule, a counter, a price, a status or a report."""

import ast
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
SWAPS: dict[type[ast.AST], str] = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "//",
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.And: "or", ast.Or: "and",
}  # fmt: skip
CALLS = {"max": "min", "min": "max", "maximum": "minimum", "minimum": "maximum", "ceil": "floor", "sum": "max"}
WORDS = {"predicted": "fitted", "fitted": "predicted", "reported": "predicted", "published": "ours", "missed": "kept"}
PRICE = re.compile(r"(?<![\w.\"])(\d+\.?\d*)(?![\w.\"])")


@dataclass(frozen=True)
class Mutant:
    """A change of one place of one file.

    Parameters
    ----------
    room : str
        A name of ``rooms.ROOMS``.
    path : str
        File, from the root.
    where : str
        Function (or table) and what is changed there: with ``path`` it names the mutant.
    text : str
        The whole file, changed.
    """

    room: str
    path: str
    where: str
    text: str

    @property
    def name(self) -> str:
        """As ``survivors.toml`` has it."""
        return f"{self.path}: {self.where}"


def sample(room: str, paths: list[str], number: int, seed: int = 0) -> list[Mutant]:
    """Choose mutants of some files at random, the same ones for a seed while the files stay as they are."""
    made = [mutant for path in paths for mutant in mutants_of(room, path)]
    return random.Random(f"{room} {seed}").sample(made, min(number, len(made)))  # noqa: S311 - no secret


def mutants_of(room: str, path: str) -> Iterator[Mutant]:
    """All mutants of one file."""
    text = (ROOT / path).read_text("utf-8")
    changes = _python(text, counters=room == "counters") if path.endswith(".py") else _toml(text)
    seen: dict[str, int] = {}
    for where, begin, end, new in changes:
        seen[where] = seen.get(where, 0) + 1
        yield Mutant(room, path, f"{where} #{seen[where]}", text[:begin] + new + text[end:])


Change = tuple[str, int, int, str]  # where, first and last character, what stands there instead


def _toml(text: str) -> Iterator[Change]:
    """Each number of a mix or a machine, a tenth larger."""
    table, place = "", 0
    for line in text.splitlines(keepends=True):
        code = line.split("#")[0]
        if code.startswith("["):
            table = code.strip().strip("[]")
        elif "=" in code and "source" not in code.split("=")[0] and table != "identity":
            key, _, value = code.partition("=")
            found = PRICE.search(value.split("provenance")[0])
            if found:
                old = found[1]
                new = f"{float(old) * 1.1:.6g}" if "." in old else str(int(old) + max(1, round(int(old) / 10)))
                begin = place + len(key) + 1 + found.start(1)
                yield f"{table}.{key.strip()} {old} -> {new}", begin, begin + len(old), new
        place += len(line)


def _python(text: str, *, counters: bool) -> Iterator[Change]:
    """Changes of operators, comparisons, constants, calls, words and counts."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line.encode()))
    data = text.encode()

    def at(line: int, column: int) -> int:
        return len(data[: starts[line - 1] + column].decode())

    for function, node in _nodes(ast.parse(text)):
        for what, first, last, new in _changes(node, counters=counters):
            begin, end = at(*first), at(*last)
            old = text[begin:end]
            yield f"{function}: {what(old) if callable(what) else what}", begin, end, new(old) if callable(new) else new


def _nodes(tree: ast.AST, function: str = "module") -> Iterator[tuple[str, ast.AST]]:
    """Nodes of functions, without docstrings, annotations and types."""
    for child in ast.iter_child_nodes(tree):
        if isinstance(child, (ast.FunctionDef, ast.ClassDef)):
            body = child.body[1:] if ast.get_docstring(child) else child.body
            for statement in body:
                yield child.name, statement
                yield from _nodes(statement, child.name)
        elif not (isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)):
            if function != "module" and not _is_annotation(tree, child):
                yield function, child
            yield from _nodes(child, function)


def _is_annotation(parent: ast.AST, child: ast.AST) -> bool:
    return child is getattr(parent, "annotation", None) or isinstance(child, ast.arguments)


def _changes(node: ast.AST, *, counters: bool) -> Iterator[tuple]:
    """What may be changed at one node: (what, first position, last position, new text)."""
    counted = isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Subscript)
    if counters:
        if counted:
            value = node.value
            end = (value.end_lineno, value.end_col_offset)
            yield lambda old: f"{old} doubled", (value.lineno, value.col_offset), end, lambda old: f"2 * ({old})"
            whole = (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
            yield lambda old: f"without {old}", *whole, "pass"
        return
    if isinstance(node, ast.BinOp) and type(node.op) in SWAPS:
        yield _between(node.left, node.right, SWAPS[type(node.op)])
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPS:
        yield _between(node.left, node.comparators[0], SWAPS[type(node.ops[0])])
    elif isinstance(node, ast.BoolOp):
        yield _between(node.values[0], node.values[1], SWAPS[type(node.op)])
    elif isinstance(node, ast.Constant):
        yield from _constant(node)
    elif isinstance(node, ast.Name) and node.id in CALLS:
        yield f"{node.id} -> {CALLS[node.id]}", *_span(node), CALLS[node.id]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "without not", (node.lineno, node.col_offset), (node.operand.lineno, node.operand.col_offset), ""


def _constant(node: ast.Constant) -> Iterator[tuple]:
    if isinstance(node.value, str) and node.value in WORDS:
        yield f"{node.value} -> {WORDS[node.value]}", *_span(node), repr(WORDS[node.value])
    elif isinstance(node.value, (int, float)):
        new = (
            not node.value
            if isinstance(node.value, bool)
            else node.value + 1
            if isinstance(node.value, int)
            else 1.1 * node.value or 1.0
        )
        yield f"{node.value} -> {new}", *_span(node), repr(new)


def _between(left: ast.expr, right: ast.expr, new: str) -> tuple:
    """Change the operator between two operands; parentheses around them stay."""

    def changed(old: str) -> str:
        return re.sub(r"[^\s()\[\]]+", lambda _: new, old, count=1)

    first, last = (left.end_lineno, left.end_col_offset), (right.lineno, right.col_offset)
    return lambda old: f"{old.strip(' ()')} -> {new}", first, last, changed


def _span(node: ast.expr) -> tuple[tuple[int, int], tuple[int, int]]:
    return (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
