"""Columns of work tables go by the names of their events: a number would miscount once a member is inserted.

A table is called ``table`` or ``events``, a row of it ``row``, a sum of rows ``total``; what a function makes from one
counts as one. What names a column is an event, or comes from a name, and is neither a number nor reckoned.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import tilestamp

PACKAGE = Path(tilestamp.__file__).parent
TABLES = {"table", "events"}
ROWS = {"row", "total"}
LENDING = ("row_of", "borrow")  # functions that return a part of what they are given
EVENT = re.compile(r"\.[A-Z][A-Z_]+\b")
LENGTH = re.compile(r", len\((\w+Event|_?[A-Z]|event)\)\)$")


def is_table(node: ast.expr, known: set[str]) -> bool:
    """Whether an expression is a work table, part of one, or a sum over one."""
    if isinstance(node, ast.Name):
        return node.id in known
    if isinstance(node, ast.Attribute):
        return node.attr in TABLES
    if isinstance(node, ast.IfExp):
        return is_table(node.body, known) or is_table(node.orelse, known)
    if isinstance(node, ast.Subscript):
        return is_table(node.value, known)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return node.func.id in LENDING and is_table(node.args[0], known)
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and is_table(node.func.value, known)


def allocates(node: ast.expr) -> bool:
    """Whether an expression makes a work table: ``np.zeros((units, len(SomeEvent)), np.int64)``."""
    node = node.body if isinstance(node, ast.IfExp) else node
    is_zeros = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "zeros"
    return is_zeros and LENGTH.search(ast.unparse(node.args[0])) is not None


def assigned(tree: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Each name with what it is set to: by assignments, and by loops over tuples that are written out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            yield from ((target.id, node.value) for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.For) and isinstance(node.target, ast.Name) and isinstance(node.iter, ast.Tuple):
            yield from ((node.target.id, value) for value in node.iter.elts)


def work_tables(function: ast.FunctionDef) -> set[str]:
    """Names in a function that stand for work tables and their parts."""
    known = {arg.arg for arg in function.args.args} & (TABLES | ROWS)
    for name, value in assigned(function):
        if allocates(value) or is_table(value, known):
            known.add(name)
    return known


def reckoned(column: ast.expr, numbers: set[str]) -> bool:
    """Whether a column is a number, stands for one, or is reckoned."""
    if isinstance(column, ast.Constant):
        return type(column.value) is int
    if isinstance(column, ast.Name):
        return column.id in numbers
    if isinstance(column, (ast.Attribute, ast.Subscript, ast.Call)):
        return False
    if isinstance(column, ast.IfExp):
        return reckoned(column.body, numbers) or reckoned(column.orelse, numbers)
    return isinstance(column, (ast.BinOp, ast.UnaryOp)) or any(
        reckoned(part, numbers) for part in ast.iter_child_nodes(column) if isinstance(part, ast.expr)
    )


def faults(tree: ast.Module) -> Iterator[str]:
    """Subscripts of work tables in which a number names a column."""
    numbers = {name for name, value in assigned(tree) if isinstance(value, ast.Constant) and type(value.value) is int}
    for function in functions(tree):
        known = work_tables(function)
        for node in ast.walk(function):
            if not (isinstance(node, ast.Subscript) and is_table(node.value, known)):
                continue
            column = node.slice.elts[-1] if isinstance(node.slice, ast.Tuple) else node.slice
            picks_rows = not isinstance(node.slice, ast.Tuple) and ast.unparse(node.value) not in ROWS
            if picks_rows and not (isinstance(column, ast.Constant) or EVENT.search(ast.unparse(column))):
                continue
            if reckoned(column, numbers):
                yield f"line {node.lineno}: {ast.unparse(node)}"


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def renames(tree: ast.Module, everywhere: dict[str, ast.FunctionDef]) -> Iterator[str]:
    """Parameters that are given a work table and have another name: the rule would not see them."""
    defined = everywhere | {function.name: function for function in functions(tree)}
    for function in functions(tree):
        known = work_tables(function)
        for node in ast.walk(function):
            if isinstance(node, ast.Call):
                yield from renamed(node, known, defined)


def renamed(call: ast.Call, known: set[str], defined: dict[str, ast.FunctionDef]) -> Iterator[str]:
    """As ``renames``, of one call."""
    name, given = ast.unparse(call.func), call.args
    if name == "for_parts":  # (function, parts, *the rest): calls it with (part, parts, *the rest)
        name = ast.unparse(given[0])
    if name not in defined or name in LENDING:
        return
    parameters = [arg.arg for arg in defined[name].args.args]
    stars = [i for i, arg in enumerate(given) if isinstance(arg, ast.Starred)]
    first, last = (stars[0], stars[-1]) if stars else (len(given), -1)
    pairs = list(zip(given[:first], parameters, strict=False)) + list(
        zip(given[:last:-1], parameters[::-1], strict=False)
    )
    for argument, parameter in pairs:
        if isinstance(argument, ast.Name) and argument.id in known and parameter not in TABLES | ROWS:
            yield f"line {call.lineno}: {parameter} of {name}"


def trees(*rooms: str) -> dict[str, ast.Module]:
    """Modules of some rooms, by path."""
    paths = sorted(path for room in rooms for path in (PACKAGE / room).rglob("*.py"))
    return {str(path.relative_to(PACKAGE)): ast.parse(path.read_text()) for path in paths}


def test_no_number_names_a_column_of_a_work_table():
    modules = trees("models", "simulator", "experiments")
    assert {path: found for path, tree in modules.items() if (found := list(faults(tree)))} == {}


@pytest.mark.parametrize(
    "statement",
    [
        "row[3] += 1",
        "row[E.WARPS + 1] += 1",
        "for column in (3, 4): row[column] += 1",
        "mine = row_of(events, i); mine[3] += 1",
        "events[i, 3] = 1",
        "events[:, 3:5] = 1",
        "table = np.zeros((n, len(SomeEvent)), np.int64); table[..., [E.WARPS, 3]] = 1",
        "x = events.sum(axis=0)[3]",
        "x = work.table[:, 3]",
    ],
)
def test_a_number_for_a_column_is_found(statement):
    assert len(list(faults(ast.parse(f"def f(row, events):\n    {statement}")))) == 1


def test_a_work_table_keeps_its_name_from_function_to_function():
    modules = trees("simulator/stages")
    everywhere = {function.name: function for tree in modules.values() for function in functions(tree)}
    assert {path: found for path, tree in modules.items() if (found := list(renames(tree, everywhere)))} == {}
