"""Who imports what: no circles, and nothing private across modules.

Imports inside functions and those that only a type checker sees count as well.
"""

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import tilestamp

PACKAGE = Path(tilestamp.__file__).parent
ROOMS = ("models", "simulator", "experiments", "reports")


def module_name(path: Path) -> str:
    parts = ("tilestamp", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def trees() -> dict[str, ast.Module]:
    paths = [path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")]
    return {module_name(path): ast.parse(path.read_text()) for path in paths}


def imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Each name that is imported from a module of ours, with that module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tilestamp"):
            yield from ((node.module or "", alias.name) for alias in node.names)


def imported(tree: ast.Module, modules: set[str]) -> set[str]:
    """Modules that a module imports."""
    return {f"{module}.{name}" if f"{module}.{name}" in modules else module for module, name in imports(tree)}


def private(importer: str, tree: ast.Module) -> list[str]:
    """Names with an underscore that a module imports: of other modules, or modules of other packages."""
    package = importer.rpartition(".")[0]
    wrong = []
    for module, name in imports(tree):
        folder, _, last = module.rpartition(".")
        if name.startswith("_") or (last.startswith("_") and folder != package):
            wrong.append(f"{importer}: {name} of {module}")
    return wrong


def test_no_modules_import_one_another_in_a_circle():
    modules = trees()
    graph = {name: imported(tree, set(modules)) - {name} for name, tree in modules.items()}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def test_nothing_private_is_imported_from_another_module():
    assert [wrong for name, tree in trees().items() for wrong in private(name, tree)] == []


def test_tests_import_nothing_private():
    paths = Path(__file__).parent.rglob("*.py")
    assert [wrong for path in paths for wrong in private(path.stem, ast.parse(path.read_text()))] == []


@pytest.mark.parametrize("line", ["from tilestamp.a.b import _x", "from tilestamp.a._b import x"])
def test_what_is_private_is_found(line):
    assert private("tilestamp.c.d", ast.parse(line))


def test_a_private_module_may_be_imported_in_its_package():
    assert private("tilestamp.a.d", ast.parse("from tilestamp.a._b import x")) == []
