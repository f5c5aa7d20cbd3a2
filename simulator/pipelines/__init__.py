"""One module for each published system; it reads like its overview figure.

A pipeline is a function that bears its module's name:
``pipeline(scene, matrix, width, height, simt, *, options...) -> Frame``.

Two keywords are no options: ``sample``, a ``Sampler`` by which expensive stages run on part of their units, and
``picture``, which says whether one is wanted. ``simulate`` hands them to the pipelines that have them.
"""

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.frame import Frame

Pipeline = Callable[..., Frame]
INTERNAL = ("sample", "picture")  # keywords that a pipeline may have for simulate


def pipeline_names() -> list[str]:
    """Names of all pipelines, as a user writes them (``across-polygons``)."""
    return sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[a-z]*.py"))


def load_pipeline(name: str) -> Pipeline:
    """Import the pipeline ``name``.

    Raises
    ------
    TilestampError
        There is none of that name.
    """
    if name not in pipeline_names():
        raise TilestampError(f"no pipeline is called {name}; there are {', '.join(pipeline_names())}")
    module = name.replace("-", "_")
    pipeline: Pipeline = getattr(import_module(f"tilestamp.simulator.pipelines.{module}"), module)
    return pipeline


def pipeline_options(name: str) -> dict[str, inspect.Parameter]:
    """Options of the pipeline ``name``: its keyword-only parameters, less what ``simulate`` itself hands over."""
    return {key: p for key, p in _keywords(name).items() if key not in INTERNAL}


def takes(name: str, keyword: str) -> bool:
    """Whether the pipeline ``name`` can be handed ``sample`` (run part of the units) or ``picture`` (draw none)."""
    return keyword in _keywords(name)


def _keywords(name: str) -> dict[str, inspect.Parameter]:
    parameters = inspect.signature(load_pipeline(name)).parameters
    return {key: p for key, p in parameters.items() if p.kind is p.KEYWORD_ONLY}
