"""Experiments by name: a module in a paper's folder that has a function ``run`` is one (``eisenacher2010/table1``).

Its ``QUESTION`` is what it answers. A module that says ``SLOW = True`` runs only when it is named, or when all are
asked for. A folder whose experiments share frames says ``ONE_PROCESS = True``.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from tilestamp.experiments.harness.result import Result
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean

Progress = Callable[[str], None]
Experiment = Callable[[Progress], Result]
FOLDER = Path(__file__).parents[1]


def experiment_names() -> list[str]:
    """All experiments, ``paper/table``."""
    modules = (path for path in FOLDER.glob("*/[a-z]*.py") if "\ndef run(" in path.read_text(encoding="utf-8"))
    return sorted(f"{path.parent.name}/{path.stem}" for path in modules)


def describe(name: str) -> str:
    """First line of an experiment's docstring."""
    return (import_module(_module(name)).__doc__ or "").strip().splitlines()[0]


def question(name: str) -> str:
    """What an experiment answers: ``QUESTION`` of its module, read without importing it."""
    path = FOLDER / f"{name}.py"
    body = ast.parse(path.read_text("utf-8")).body if path.is_file() else []
    for line in body:
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "QUESTION":
            return str(ast.literal_eval(line.value))
    return ""


def describe_folder(folder: str) -> str:
    """First line of the docstring of a folder of experiments; its name where there is none."""
    if not (FOLDER / folder / "__init__.py").is_file():
        return folder
    return (import_module(f"tilestamp.experiments.{folder}").__doc__ or folder).strip().splitlines()[0]


def folder_name(name: str) -> str:
    """Folder of an experiment's result."""
    return name.replace("/", "-")


def load_experiment(name: str) -> Experiment:
    """The function that runs the experiment ``name``."""
    experiment: Experiment = import_module(_module(name)).run
    return experiment


def process_of(name: str) -> str:
    """Experiments of one name here run in one process: those of a folder that says ``ONE_PROCESS = True``."""
    folder = name.split("/", maxsplit=1)[0]
    return folder if getattr(import_module(f"tilestamp.experiments.{folder}"), "ONE_PROCESS", False) else name


def is_slow(name: str) -> bool:
    """Whether an experiment is left out where nothing is named."""
    return "\nSLOW = True" in (FOLDER / f"{name}.py").read_text(encoding="utf-8")


def select(names: tuple[str, ...], *, everything: bool = False) -> list[str]:
    """Experiments for what a user names: ``paper/table``, how a paper begins, a table; quick ones if none.

    Parameters
    ----------
    names : tuple of str
    everything : bool
        All of them, the slow ones too.

    Raises
    ------
    TilestampError
        A name that fits none.
    """
    known = experiment_names()
    chosen: list[str] = []
    for name in names:
        alike = [k for k in known if name in k.split("/") or k.startswith(name)]
        fits = [name] if name in known else alike
        if not fits:
            near = did_you_mean(name, known)
            raise TilestampError(f"no experiment is called {name}{near}; tilestamp list experiments names all")
        chosen += fits
    if chosen:
        return list(dict.fromkeys(chosen))
    return [name for name in known if everything or not is_slow(name)]


def _module(name: str) -> str:
    return f"tilestamp.experiments.{name.replace('/', '.')}"
