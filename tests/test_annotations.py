"""Types: mypy is strict about all of the package, kernels are annotated by a rule of their own, nobody else takes Any.

A kernel's whole numbers are int, its switches bool, its float64 numbers float, its structs go by their class. Arrays
are Any, and so are numbers of a chosen width and structs of several kinds: Numba compiles for what it is given.
"""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import tilestamp

PACKAGE = Path(tilestamp.__file__).parent
NUMBERS = {"int", "bool", "float", "Any"}
FOREIGN = {  # what they take belongs to a library without types
    "models/kernel.py": "numba",
    "models/kernel_cache.py": "numba",
    "models/kernel_library.py": "numba",
    "models/compile_quicker.py": "numba",
    "models/kernel_digest.py": "numba",
    "models/bits.py": "numba",
    "simulator/stages/borrow.py": "numba",
    "simulator/stages/prefetch.py": "numba",
    "simulator/stages/vectors.py": "numba",
    "simulator/stages/kerbl2023/blend_step.py": "numba",
    "simulator/stages/laine2011/exact.py": "numba",
    "simulator/stages/laine2011/lanes.py": "numba",
    "simulator/stages/ru2016/row_lanes.py": "numba",
    "simulator/stages/laine2011/tile_pixels.py": "numba",
    "simulator/stages/zhang2025/stepped_tile.py": "numba",
    "experiments/harness/cluster.py": "joblib",
    "experiments/validation/gpu_cases.py": "CuPy",
    "experiments/validation/measuring_sm.py": "CuPy",
}


def functions(source: str, *, kernels: bool) -> Iterator[ast.FunctionDef]:
    """Functions of a module that are kernels, or that are not."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and kernels == any(
            ast.unparse(decorator).startswith("kernel") for decorator in node.decorator_list
        ):
            yield node


def parameters(function: ast.FunctionDef) -> list[tuple[str, str]]:
    """Name and annotation of each parameter; what collects the rest may be anything, and so may what is not used."""
    every = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    used = (argument for argument in every if not argument.arg.startswith("_"))
    return [(argument.arg, ast.unparse(argument.annotation) if argument.annotation else "") for argument in used]


def against_the_rule(source: str) -> list[str]:
    """Parameters of kernels that are annotated as the rule does not say."""
    return [
        f"{function.name}: {name}"
        for function in functions(source, kernels=True)
        for name, annotation in parameters(function)
        if annotation not in NUMBERS and not (annotation.isidentifier() and annotation.lstrip("_")[:1].isupper())
    ]


def takers_of_any(source: str) -> list[str]:
    """Parameters of other functions that are Any."""
    return [
        f"{function.name}: {name}"
        for function in functions(source, kernels=False)
        for name, annotation in parameters(function)
        if annotation == "Any"
    ]


def modules() -> list[str]:
    floors = ("models", "simulator", "experiments", "reports")
    return [
        f"{floor}/{path.relative_to(PACKAGE / floor)}" for floor in floors for path in (PACKAGE / floor).rglob("*.py")
    ]


def test_kernels_are_annotated_by_the_rule():
    found = {name: against_the_rule((PACKAGE / name).read_text("utf-8")) for name in modules()}
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


def test_only_kernels_take_any():
    found = {name: takers_of_any((PACKAGE / name).read_text("utf-8")) for name in modules() if name not in FOREIGN}
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


@pytest.mark.parametrize("name", FOREIGN)
def test_an_exception_is_needed(name: str):
    assert takers_of_any((PACKAGE / name).read_text("utf-8"))


def test_no_module_of_ours_is_checked_less_strictly():
    mypy = tomllib.loads(Path(PACKAGE.parent, "pyproject.toml").read_text("utf-8"))["tool"]["mypy"]
    named = [module for override in mypy["overrides"] for module in override["module"]]
    assert mypy["strict"]
    assert [module for module in named if module.startswith(("tilestamp", "*"))] == []


def test_an_array_type_in_a_kernel_is_against_the_rule():
    assert against_the_rule("@kernel\ndef f(a: NDArray[np.int64], n: int, s: Simt): ...") == ["f: a"]


def test_a_kernel_with_an_error_model_is_a_kernel():
    assert against_the_rule("@kernel(error_model='numpy')\ndef f(a): ...") == ["f: a"]


def test_a_driver_that_takes_any_is_found():
    assert takers_of_any("def f(a: Any, _b: Any, *c: Any, d: int, **e: Any): ...") == ["f: a"]
