"""A compiled kernel is kept under a name that says all that it depends on."""

import ctypes
import importlib
import os
import subprocess
import sys

import numba
import pytest

from tilestamp.models import compile_cache, kernel_library

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled with NUMBA_DISABLE_JIT")

SOURCES = {
    "deepest.py": "FACTOR = 2\n",
    "helper.py": "from kernel_project import deepest\nfrom tilestamp.models.kernel import kernel\n\n"
    "@kernel\ndef scaled(x):\n    return x * deepest.FACTOR\n",
    "stage.py": "from kernel_project.helper import scaled\nfrom tilestamp.models.kernel import kernel\n\n"
    "@kernel\ndef stage(x):\n    return scaled(x) + 1\n\n"
    "def driver(x):\n    return stage(x)\n",
    "__init__.py": "",
}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A package of three modules, each of which needs the next; and its compiled kernels in a folder of their own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("tilestamp.models.kernel_digest.PACKAGE", "kernel_project")
    folder = tmp_path / "kernel_project"
    folder.mkdir()
    for name, text in SOURCES.items():
        (folder / name).write_text(text)
    yield folder
    _forget()


def _forget():
    for name in [name for name in sys.modules if name.startswith("kernel_project")]:
        del sys.modules[name]
    importlib.invalidate_caches()


def _kernels_compiled(folder, monkeypatch):
    """Import the package anew and run its driver: the answer, and the kernels that were compiled for it."""
    answer, told = _told(folder, monkeypatch)
    return answer, sorted({*told} - {""})


def _told(folder, monkeypatch):
    """Import the package anew and run its driver: the answer, and what a listener is told meanwhile."""
    _forget()
    sys.dont_write_bytecode = True
    told = []
    monkeypatch.setattr(compile_cache, "_listeners", [])
    compile_cache.on_compiling(told.append)
    return importlib.import_module(f"{folder.name}.stage").driver(5), told


@compiled
def test_a_listener_is_told_what_is_being_compiled_now_and_when_nothing_is(project, monkeypatch):
    assert _told(project, monkeypatch)[1] == ["stage.stage", "helper.scaled", "stage.stage", ""]


def test_only_the_last_listener_is_told(monkeypatch):
    monkeypatch.setattr(compile_cache, "_listeners", [])
    told = []
    for name in ("first", "last"):
        compile_cache.on_compiling(lambda kernel, name=name: told.append((name, kernel)))
    compile_cache.note_compiling(_forget)
    compile_cache.note_compiled()
    assert told == [("last", "test_compile_cache.forget"), ("last", "")]


def _edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@compiled
def test_what_was_compiled_is_loaded(project, monkeypatch):
    assert _kernels_compiled(project, monkeypatch) == (11, ["helper.scaled", "stage.stage"])
    assert _kernels_compiled(project, monkeypatch) == (11, [])


@compiled
@pytest.mark.parametrize(
    ("file", "old", "new", "answer"),
    [
        ("helper.py", "x * ", "3 + x * ", 14),  # an imported helper
        ("deepest.py", "FACTOR = 2", "FACTOR = 7", 36),  # a module that only the helper imports
    ],
)
def test_an_edit_of_what_a_kernel_reaches_is_seen(project, monkeypatch, file, old, new, answer):
    _kernels_compiled(project, monkeypatch)
    _edit(project / file, old, new)
    assert _kernels_compiled(project, monkeypatch) == (answer, ["helper.scaled", "stage.stage"])


@compiled
def test_an_edit_of_one_stage_compiles_only_it(project, monkeypatch):
    _kernels_compiled(project, monkeypatch)
    _edit(project / "stage.py", "+ 1", "+ 2")
    assert _kernels_compiled(project, monkeypatch) == (12, ["stage.stage"])


@compiled
@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("deepest.py", "FACTOR", "# a comment\nOTHER = 1\nFACTOR"),
        ("helper.py", "    return", "    # a comment\n    return"),
        ("stage.py", "def driver(x):", 'def driver(x):\n    """Run it."""'),
    ],
)
def test_an_edit_that_no_kernel_sees_compiles_nothing(project, monkeypatch, file, old, new):
    _kernels_compiled(project, monkeypatch)
    _edit(project / file, old, new)
    assert _kernels_compiled(project, monkeypatch) == (11, [])


@compiled
def test_a_helper_is_compiled_for_its_callers_alone_until_python_calls_it(project, monkeypatch):
    _kernels_compiled(project, monkeypatch)
    helper = importlib.import_module("kernel_project.helper")
    assert [kept.library.for_python for kept in helper.scaled.overloads.values()] == [False]
    assert helper.scaled(5) == 10
    assert [kept.library.for_python for kept in helper.scaled.overloads.values()] == [True]


@compiled
def test_a_version_of_numba_that_was_not_tried_compiles_each_helper_and_gives_the_same(project, monkeypatch):
    answers = [_kernels_compiled(project, monkeypatch)]
    monkeypatch.setattr(kernel_library, "TRIED", ())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(project / "plain"))
    answers += [_kernels_compiled(project, monkeypatch), _kernels_compiled(project, monkeypatch)]
    assert answers == [(11, ["helper.scaled", "stage.stage"])] * 2 + [(11, [])]
    assert importlib.import_module("kernel_project.helper").scaled(5) == 10


@compiled
def test_the_version_of_numba_that_the_tests_run_with_was_tried():
    assert kernel_library.gathers() == numba.__version__.startswith("0.68.")


@compiled
def test_counts_are_the_same_where_each_helper_is_compiled_by_itself(tmp_path):
    code = "import sys, numpy; from tilestamp.models import coalescing, kernel_library; "
    code += "kernel_library.TRIED = sys.argv[1:]; addresses = numpy.arange(32) ** 2 * 4; "
    code += "print([coalescing.transactions(addresses, 32, 4, rule) for rule in range(3)])"
    told = []
    for tried in (["0.68"], []):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / str(len(tried)))}
        command = [sys.executable, "-c", code, *tried]
        told += [subprocess.run(command, env=environment, capture_output=True, check=True).stdout]  # noqa: S603 - our own
    assert told[0] == told[1]
    assert told[0].startswith(b"[(")


@compiled
@pytest.mark.parametrize("jit", ["njit", "njit(cache=True)"])
def test_a_helper_of_numbas_own_can_be_called_by_python_too(project, monkeypatch, jit):
    _edit(project / "helper.py", "from tilestamp.models.kernel import kernel", "from numba import njit")
    _edit(project / "helper.py", "@kernel", f"@{jit}")
    for _ in range(2):
        assert _kernels_compiled(project, monkeypatch)[0] == 11
        assert importlib.import_module("kernel_project.helper").scaled(5) == 10
        _edit(project / "stage.py", "def stage(x):", "def stage(x):\n    x += 0")  # compiled again, its helper loaded


@compiled
def test_a_helper_of_numbas_own_that_a_kernels_helper_loads_can_be_called_by_python_too(project, monkeypatch):
    plain = "from numba import njit\n\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"
    (project / "deepest.py").write_text(plain)
    _edit(project / "helper.py", "x * deepest.FACTOR", "deepest.twice(x)")
    for _ in range(2):
        assert _kernels_compiled(project, monkeypatch)[0] == 11
        assert importlib.import_module("kernel_project.deepest").twice(5) == 10
        _edit(project / "helper.py", "return", "x += 0\n    return")


@compiled
def test_a_kernel_returns_no_array_that_is_lent_to_it(project, monkeypatch):
    _edit(project / "helper.py", "@kernel", "@kernel(lent=True)")
    _edit(project / "helper.py", "return x * deepest.FACTOR", "return x, deepest.FACTOR")
    _edit(project / "stage.py", "return stage(x)", "import numpy as np\n    return stage(np.zeros(x))")
    with pytest.raises(TypeError, match="scaled returns an array, which is lent to it"):
        _kernels_compiled(project, monkeypatch)


@compiled
def test_a_kernel_that_cannot_be_compiled_is_no_longer_being_compiled(project, monkeypatch):
    _edit(project / "helper.py", "return x *", "return x.nothing *")
    with pytest.raises(numba.TypingError):
        _kernels_compiled(project, monkeypatch)
    told = []
    compile_cache.on_compiling(told.append)
    compile_cache.note_compiled()
    assert told == [""]


@compiled
def test_what_a_kernel_has_gathered_is_hidden_from_kernels_of_other_processes(project, monkeypatch):
    """Their names are unique in one process alone: a kernel from disk called another's helper of the same name."""
    _edit(project / "helper.py", "return x * deepest.FACTOR", "return 0 if x < 1 else scaled(x - 1) + deepest.FACTOR")
    _kernels_compiled(project, monkeypatch)
    (kept,) = importlib.import_module("kernel_project.stage").stage.overloads.values()
    functions = kept.library._get_module_for_linking().functions
    linkages = {function.linkage.name for function in functions if "scaled" in function.name}
    assert linkages == {"internal"}


@compiled
def test_what_a_helper_raises_reaches_python_from_the_cache_too(project, monkeypatch):
    checked = "    if x > 4:\n        raise ValueError('too large')\n    return"
    _edit(project / "helper.py", "    return", checked)
    for _ in range(2):
        with pytest.raises(ValueError, match="too large"):
            _kernels_compiled(project, monkeypatch)


@compiled
def test_helpers_from_the_cache_and_compiled_now_make_arrays(project, monkeypatch):
    made = "import numpy as np\nfrom tilestamp.models.kernel import kernel\n\n"
    made += "@kernel\ndef scaled(x):\n    return np.full(x, 2.0)\n"
    (project / "helper.py").write_text(made)
    _edit(project / "stage.py", "scaled(x) + 1", "scaled(x)")
    _kernels_compiled(project, monkeypatch)
    _edit(project / "stage.py", "return scaled(x)", "return scaled(x) + np.full(x, 3.0)")
    _edit(project / "stage.py", "from tilestamp", "import numpy as np\nfrom tilestamp")
    answer, compiled_now = _kernels_compiled(project, monkeypatch)
    assert answer.tolist() == [5.0] * 5
    assert compiled_now == ["stage.stage"]


@compiled
def test_going_back_to_what_was_compiled_before_compiles_nothing(project, monkeypatch):
    _kernels_compiled(project, monkeypatch)
    _edit(project / "deepest.py", "FACTOR = 2", "FACTOR = 7")
    _kernels_compiled(project, monkeypatch)
    _edit(project / "deepest.py", "FACTOR = 7", "FACTOR = 2")
    assert _kernels_compiled(project, monkeypatch) == (11, [])


@compiled
def test_the_order_of_the_fields_of_a_named_tuple_counts(project, monkeypatch):
    (project / "pair.py").write_text(
        "from typing import NamedTuple\n\nclass Pair(NamedTuple):\n    a: int\n    b: int\n"
    )
    stage = "from kernel_project.pair import Pair\nfrom tilestamp.models.kernel import kernel\n\n"
    stage += "@kernel\ndef stage(pair):\n    return 10 * pair.a + pair.b\n\n"
    (project / "stage.py").write_text(stage + "def driver(x):\n    return stage(Pair(a=x, b=1))\n")
    assert _kernels_compiled(project, monkeypatch)[0] == 51
    _edit(project / "pair.py", "a: int\n    b: int", "b: int\n    a: int")
    assert _kernels_compiled(project, monkeypatch)[0] == 51


BROKEN = {
    "no pickle": b"not an index",
    "empty": b"",
    "no such version": b"\x80\xff",
    "no text": b"\x8c\x01\x8a.",
    "longer than memory": b"\x8e" + b"\xff" * 7 + b"\x7f.",
    "a number": b"K\x01.",
}


@compiled
@pytest.mark.parametrize("content", BROKEN.values(), ids=BROKEN.keys())
def test_a_file_of_the_cache_that_cannot_be_read_is_made_anew(project, monkeypatch, content):
    _kernels_compiled(project, monkeypatch)
    for file in compile_cache.cache_folder().glob("*.nbc"):
        file.write_bytes(content)
    for compiled_now in (["helper.scaled", "stage.stage"], []):
        assert _kernels_compiled(project, monkeypatch) == (11, compiled_now)


@compiled
def test_a_helper_whose_bitcode_cannot_be_read_is_made_anew(project, monkeypatch):
    _kernels_compiled(project, monkeypatch)
    (file,) = (path for path in compile_cache.cache_folder().glob("helper.scaled*.nbc"))
    file.write_bytes(file.read_bytes().replace(b"BC\xc0\xde", b"....", 1))
    _edit(project / "stage.py", "+ 1", "+ 2")
    assert _kernels_compiled(project, monkeypatch) == (12, ["helper.scaled", "stage.stage"])


@pytest.mark.parametrize("stumbles", [False, True])
def test_ctrl_c_that_a_callback_drops_ends_the_compiler(stumbles):
    @ctypes.CFUNCTYPE(None)
    def interrupted():
        raise KeyboardInterrupt

    def compiled():
        with compile_cache.interruptible():
            interrupted()
            if stumbles:
                raise RuntimeError("no compiled object yet")

    with pytest.raises(KeyboardInterrupt):
        compiled()
