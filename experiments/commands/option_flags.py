"""Flags of a pipeline's options, made from its struct: ``--tile 8``, ``--no-cull-backfaces``, ``-O tile=8``."""

import ast
import inspect
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import wraps
from typing import Annotated, Any

import msgspec
from cyclopts import App, Group, Parameter

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.options import Options, checked, descriptions, takes
from tilestamp.simulator.pipelines import options_type

WORDS = {"true": True, "false": False, "none": None}
Command = Callable[..., None]


def named_pipeline(arguments: Sequence[str], otherwise: str) -> str:
    """Pipeline that a command line names, whatever else it says."""
    if not any("pipeline" in argument for argument in arguments):
        return otherwise

    def pipeline_of(*, pipeline: str = otherwise) -> str:
        return pipeline

    app = App(default_command=pipeline_of, help_flags=[], version_flags=[])
    command, bound, _, _ = app.parse_known_args(list(arguments))
    name: str = command(**bound.kwargs)
    return name


def with_flags(command: Command, pipeline: str) -> Command:
    """Give a command, in place of its ``**flags``, a flag for each option of a pipeline."""

    @wraps(command)
    def called(*arguments: Any, **keywords: Any) -> None:
        command(*arguments, **keywords)

    signature = inspect.signature(command)
    own = [parameter for parameter in signature.parameters.values() if parameter.kind is not parameter.VAR_KEYWORD]
    called.__signature__ = signature.replace(parameters=[*own, *_flags(pipeline)])  # type: ignore[attr-defined]
    return called


def _flags(pipeline: str) -> list[inspect.Parameter]:
    group = Group(f"Options of the pipeline {pipeline}", sort_key=1)
    flags = []
    for name, option in option_table(options_type(pipeline)).items():
        if option["takes"].startswith("an array"):
            continue  # in the library alone
        switch = option["takes"].startswith("true, false") or option["takes"] == "true or false"
        text = f"{option['what']} [{'' if switch else option['takes'] + '; '}default {option['default']}]"
        written = bool | None if switch else str | None
        kept = Annotated[written, Parameter(group=group, help=text, show_default=False)]  # type: ignore[valid-type]
        flags.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kept))
    return flags


def option_table(kind: type[Options]) -> dict[str, dict[str, str]]:
    """What each option takes, what it is by default, and what it is, by option."""
    what = descriptions(kind)
    return {
        field.name: {"takes": takes(field.type), "default": shown(field.default), "what": what[field.name]}
        for field in msgspec.structs.fields(kind)
    }


def shown(value: object) -> str:
    """A value as it is written on the command line."""
    return str(value).lower() if value is None or isinstance(value, bool) else str(value)


def given_options(
    kind: type[Options], flags: dict[str, str | bool | None], assignments: Iterable[str]
) -> dict[str, Any]:
    """Options given by flags and by ``NAME=VALUE``, each once.

    Raises
    ------
    TilestampError
        For what is given twice.
    """
    said = [(name, value) for name, value in flags.items() if value is not None]
    said += [(name.replace("-", "_"), value) for name, value in map(parted, assignments)]
    types = {field.name: field.type for field in msgspec.structs.fields(kind)}
    return {name: read(types.get(name), name, value) for name, value in once(said).items()}


def once(said: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Names and values as a dict; raises TilestampError for a name that comes twice."""
    found: dict[str, Any] = {}
    for name, value in said:
        if name in found:
            raise TilestampError(f"{name} is given twice: {shown(found[name])} and {shown(value)}")
        found[name] = value
    return found


def parted(text: str) -> tuple[str, str]:
    """Take ``NAME=VALUE`` apart."""
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise TilestampError(f"write NAME=VALUE, not {text}")
    return name, value


def read(kind: object, name: str, text: str | bool) -> Any:
    """Value of an option from text: a word, or the text as it stands, where the option takes that; else a number."""
    if kind is None or isinstance(text, bool):
        return text
    for value in (WORDS.get(text.lower(), text), text):
        with suppress(TilestampError):
            return checked(name, kind, value)
    return literal(text)


def literal(text: str) -> object:
    """Number, tuple, true, false or none that is written in a text; the text itself where it is none of them."""
    if text.lower() in WORDS:
        return WORDS[text.lower()]
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
