"""Other processes compile ahead what a run needs, and nobody compiles what another does."""

import pickle
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest

from tilestamp import simulate
from tilestamp.models import compile_ahead, compile_cache
from tilestamp.models.kernel import interpreted, kernel
from tilestamp.models.kernel_files import KernelFiles, release
from tilestamp.models.machine import load_machine
from tilestamp.simulator.launchable import able_machines
from tilestamp.simulator.pipelines import pipeline_names, pipeline_options
from tilestamp.simulator.rehearsal import rehearse, small
from tilestamp.simulator.scenes import load_scene

compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@kernel
def _twice(x):
    return 2 * x


@kernel
def _sum_of_twice(values):
    total = 0.0
    for value in values:
        total += _twice(value)
    return total


def rehearsed(values):
    return _sum_of_twice(values) + _twice(1)


@compiled
def test_a_rehearsal_lists_what_python_calls_with_its_types():
    with interpreted() as calls:
        assert rehearsed(np.ones(3)) == 8.0
    assert [(found.py_func.__name__, types) for found, types in calls] == [
        ("_sum_of_twice", (numba.float64[::1],)),
        ("_twice", (numba.int64,)),
    ]
    assert not _sum_of_twice.overloads
    assert rehearsed(np.ones(3)) == 8.0  # compiled again


@compiled
def test_a_missing_kernel_has_all_that_are_rehearsed_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compile_ahead, "get_num_threads", lambda: 2)
    compile_ahead._stop()
    compile_ahead.compile_ahead(rehearsed, np.ones(3))
    compile_cache.note_missing()
    (helper,) = compile_ahead._helpers
    try:
        helper.wait(60)
        assert len(list(compile_cache.cache_folder().glob("test_compile_ahead._*.nbc"))) >= 2
    finally:
        compile_ahead._stop()


def test_on_one_core_nobody_is_started(monkeypatch):
    monkeypatch.setattr(compile_ahead, "get_num_threads", lambda: 1)
    compile_ahead._stop()
    compile_ahead.compile_ahead(rehearsed, np.ones(3))
    compile_cache.note_missing()
    assert not compile_ahead._helpers


def test_a_helper_imports_nothing_that_lies_in_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").touch()
    monkeypatch.chdir(tmp_path)
    rehearsed = tmp_path / "rehearsed"
    helper = compile_ahead._started(pickle.dumps((Path.touch, (rehearsed,))))
    helper.wait(60)
    helper.stdin.close()
    assert rehearsed.exists()


def test_a_helper_ends_with_its_parent(tmp_path):
    code = "import time; from tilestamp.models import compile_ahead as ahead; import pickle;"
    code += (
        "helper = ahead._started(pickle.dumps((time.sleep, (600,)))); print(helper.pid, flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as parent:  # noqa: S603 - our own
        helper = int(parent.stdout.readline())
        parent.kill()
    end = time.monotonic() + 30
    while _runs(helper):
        assert time.monotonic() < end
        time.sleep(0.05)


def _runs(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_who_finds_a_kernel_claimed_gets_it_when_it_is_released(tmp_path):
    code = "import sys, time; from tilestamp.models.kernel_files import KernelFiles\n"
    code += "print(KernelFiles(sys.argv[1], 'k').claim('key'), flush=True); sys.stdin.read()"
    files, command = KernelFiles(str(tmp_path), "k"), [sys.executable, "-c", code, str(tmp_path)]
    try:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:  # noqa: S603 - our own
            assert other.stdout.readline() == b"True\n"
            assert files.claim("another key", 0.0)
            assert not files.claim("key", 0.0)
            other.stdin.close()
            assert files.claim("key", 30.0)
    finally:
        release()


def test_what_is_written_for_one_key_is_not_read_for_another(tmp_path):
    files = KernelFiles(str(tmp_path), "k")
    files.save(("int64",), 1)
    files.save(("float64",), 2)
    assert [files.load(key) for key in (("int64",), ("float64",), ("none",))] == [1, 2, None]
    assert {path.suffix for path in tmp_path.iterdir()} == {".nbc"}


@compiled
def test_a_rehearsal_lists_all_kernels_that_the_run_calls(monkeypatch):
    called, machine = set(), load_machine("gtx280")
    dispatcher, call = type(_twice), type(_twice).__call__

    def noted(kernel, *args):
        called.add(kernel.py_func.__name__)
        return call(kernel, *args)

    with monkeypatch.context() as patched:
        patched.setattr(dispatcher, "__call__", noted)
        assert simulate("teapot", "micropolygon", machine, width=320, height=240).milliseconds > 0
    with interpreted() as calls:
        rehearse(simulate, small(load_scene("teapot")), "micropolygon", machine, {"fidelity": "schedule"}, {})
    assert len(called) > 5
    assert called - {kernel.py_func.__name__ for kernel, _ in calls} <= {"_group"}  # of launches of many blocks alone


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy, of what compiled code does in silence
@pytest.mark.parametrize("pipeline", pipeline_names())
def test_every_pipeline_can_be_rehearsed(pipeline):
    options = pipeline_options(pipeline, {})
    machine = load_machine(next(able_machines(pipeline, options)))
    scene = "playbot" if options.splats else "teapot" if pipeline == "binned" else "spot"
    with interpreted() as calls:
        rehearse(simulate, small(load_scene(scene)), pipeline, machine, {"fidelity": "schedule"}, {})
    assert len(calls) > 3
