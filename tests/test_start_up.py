"""What is loaded, and when: each command loads what it needs, and the list of commands none of it."""

import importlib
import inspect
import subprocess
import sys

import numba
import pytest

from tilestamp.experiments.command_line import COMMANDS

SLOW = ["numpy", "numba", "pandas", "matplotlib", "trimesh", "PIL", "scipy"]


def _loaded(code):
    """Which slow libraries a fresh interpreter has loaded after some code."""
    code = f"import sys\n{code}\nprint(','.join(m for m in {SLOW} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    return done.stdout.splitlines()[-1].split(",")


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], []])
def test_the_list_of_commands_loads_no_slow_library(arguments):
    code = f"from tilestamp.experiments.command_line import run_command\nrun_command({arguments})"
    assert _loaded(code) == [""]


def test_the_package_loads_no_slow_library():
    assert _loaded("import tilestamp\nassert tilestamp.__version__ and 'simulate' in dir(tilestamp)") == [""]


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is loaded from the cache with NUMBA_DISABLE_JIT")
def test_render_loads_numpy_and_numba_alone():
    arguments = ["render", "teapot", "--size", "64x48"]
    code = f"from tilestamp.experiments.command_line import run_command\nassert run_command({arguments}) == 0"
    _loaded(code)  # what is not compiled yet loads more
    assert set(_loaded(code)) - {"scipy"} == {"numpy", "numba"}  # numba asks scipy for its version


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_of_each_what_it_says_itself(name):
    place, line = COMMANDS[name]
    module, _, function = place.partition(":")
    command = getattr(importlib.import_module(f"tilestamp.experiments.commands.{module}"), function)
    own = inspect.getdoc(command) if inspect.isfunction(command) else command.help
    assert line == " ".join(own.partition("\n\n")[0].split())
