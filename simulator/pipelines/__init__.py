"""One module for each published system; it reads like its overview figure.

A pipeline is a function that bears its module's name:
``pipeline(scene, matrix, width, height, simt, *, options...) -> Frame``.
"""

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from models.errors import TilestampError
from simulator.frame import Frame

Pipeline = Callable[..., Frame]


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
    pipeline: Pipeline = getattr(import_module(f"simulator.pipelines.{module}"), module)
    return pipeline


def pipeline_options(name: str) -> dict[str, inspect.Parameter]:
    """Options of the pipeline ``name``: its keyword-only parameters."""
    parameters = inspect.signature(load_pipeline(name)).parameters
    return {key: p for key, p in parameters.items() if p.kind is p.KEYWORD_ONLY}
