"""One module for each published system; it reads like its overview figure.

A pipeline is a function that bears its module's name, and a struct of its options beside it:
``pipeline(scene, matrix, width, height, simt, options, execute) -> Frame``. It hands every stage to its executor
(``simulator.executor``), which runs all of it or part of it, counts or not, and keeps what the stages did.
"""

import inspect
from collections.abc import Callable
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import Options, make_options

Pipeline = Callable[..., Frame]


def pipeline_names() -> list[str]:
    """Names of all pipelines, as a user writes them (``across-polygons``)."""
    return sorted(module.name.replace("_", "-") for module in iter_modules(__path__) if not module.name.startswith("_"))


def load_pipeline(name: str) -> Pipeline:
    """Import the pipeline ``name``.

    Raises
    ------
    TilestampError
        There is none of that name.
    """
    if not isinstance(name, str) or name not in pipeline_names():
        known = pipeline_names()
        raise TilestampError(
            f"no pipeline is called {name}{did_you_mean(str(name), known)}; there are {', '.join(known)}"
        )
    module = name.replace("-", "_")
    pipeline: Pipeline = getattr(import_module(f"tilestamp.simulator.pipelines.{module}"), module)
    return pipeline


def options_type(name: str) -> type[Options]:
    """Struct of the options of the pipeline ``name``: the type of its parameter ``options``."""
    kind: type[Options] = inspect.signature(load_pipeline(name)).parameters["options"].annotation
    return kind


def pipeline_options(name: str, given: dict[str, Any]) -> Options:
    """Options of the pipeline ``name``, by default but for those given.

    Raises
    ------
    TilestampError
        An option that the pipeline has not, or a value that it does not take.
    """
    return make_options(options_type(name), given, f"the pipeline {name}")
