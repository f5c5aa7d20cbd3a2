"""Axes: a list of values, a range, or named variants that set several parameters; and how they are combined.

A factor is a list of choices, one of which each cell takes: an axis of a grid is a factor, all axes that are walked
together (zip) are one, and so are all that are sampled. The cells are the product of the factors.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeGuard

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.experiments.studies.places import place, refused
from tilestamp.models.errors import TilestampError

MOST_POINTS = 1_000_000  # of one range or sample: they are lists
Axis = Sequence[Any] | Mapping[str, Any]


@dataclass(frozen=True)
class Choice:
    """One value of an axis: what a table shows of it, and the parameters that it sets."""

    shown: dict[str, Any]
    parameters: dict[str, Any]


class Range(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Numbers from one to another, both included."""

    low: float = msgspec.field(name="from")
    high: float = msgspec.field(name="to")
    points: Annotated[int, Meta(ge=1, le=MOST_POINTS)] | None = None
    scale: Literal["linear", "log"] = "linear"

    def at(self, shares: NDArray[np.float64]) -> list[float]:
        """Numbers at shares of the way, 0 to 1."""
        if self.scale == "linear":
            return [float(number) for number in self.low + shares * (self.high - self.low)]
        if not (self.low > 0 and self.high > 0):
            raise TilestampError(f"a range on a log scale goes between numbers above 0, not {self.low:g} {self.high:g}")
        return [float(number) for number in self.low * (self.high / self.low) ** shares]


class Sample(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Some points of a space: what its axes are, how many, and which rule chooses them (``scipy.stats.qmc``)."""

    points: Annotated[int, Meta(ge=1, le=MOST_POINTS)]
    method: Literal["sobol", "latin"] = "sobol"
    seed: Annotated[int, Meta(ge=0)] = 0
    axes: dict[str, Any]


def choices(name: str, axis: Axis, *, whole: bool) -> list[Choice]:
    """All values of an axis.

    Parameters
    ----------
    name : str
        Of the parameter, or of the axis where its values are named variants.
    axis : sequence or mapping
        Values; ``{"from", "to", "points", "scale"}``; or parameters by the name of a variant.
    whole : bool
        Whether the parameter is a whole number: those of a range are rounded.
    """
    if isinstance(axis, Mapping) and not is_range(axis):
        found = [_variant(name, label, parameters) for label, parameters in axis.items()]
    else:
        found = [Choice({name: shown(value)}, {name: value}) for value in _values(axis, whole)]
    if not found:
        raise TilestampError("an axis needs a value at least")
    return found


def is_range(axis: Axis) -> TypeGuard[Mapping[str, Any]]:
    """Whether an axis is a range."""
    return isinstance(axis, Mapping) and ("from" in axis or "to" in axis)


def sampled(sample: Sample, whole: Mapping[str, bool]) -> list[Choice]:
    """Choose the points of a sample, each a choice."""
    if not sample.axes:
        raise TilestampError("a sample needs axes: a table [sample.axes]")
    shares = _shares(sample, len(sample.axes))
    columns = []
    for column, (name, axis) in enumerate(sample.axes.items()):
        with place("sample", "axes", name):
            columns.append(at_shares(name, axis, shares[:, column], whole.get(name, False)))
    return [merged(row) for row in zip(*columns, strict=True)]


def zipped(axes: Mapping[str, list[Choice]]) -> list[Choice]:
    """Walk axes together: the first values of all, the second ones..."""
    lengths = {name: len(values) for name, values in axes.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise TilestampError(f"axes that are walked together need as many values each; {told}")
    return [merged(row) for row in zip(*axes.values(), strict=True)]


def merged(parts: Sequence[Choice]) -> Choice:
    """Several choices as one."""
    whole = Choice({}, {})
    for part in parts:
        whole.shown.update(part.shown)
        whole.parameters.update(part.parameters)
    return whole


def shown(value: object) -> Any:
    """What a table shows of a value: a number, a word, a name."""
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(name := getattr(value, "name", None), str):
        return name
    return json.dumps(value) if isinstance(value, list | dict) else str(value)


def _values(axis: Axis, whole: bool) -> list[Any]:
    """Values of a list, of a range, or the lone one."""
    if not is_range(axis):
        return list(axis) if isinstance(axis, Sequence | np.ndarray) and not isinstance(axis, str) else [axis]
    span = _range(axis)
    if span.points is None:
        raise TilestampError('a range needs points, such as { from = 1, to = 4, points = 5, scale = "log" }')
    values = span.at(np.linspace(0.0, 1.0, span.points))
    return list(dict.fromkeys(map(round, values))) if whole else values


def _range(axis: Mapping[str, Any]) -> Range:
    try:
        return msgspec.convert(dict(axis), Range)
    except msgspec.ValidationError as error:
        keys, why = refused(error)
        told = ": ".join(("a range has from, to, points and scale", *keys, why))
        raise TilestampError(told) from error


def _variant(name: str, label: str, parameters: object) -> Choice:
    if not isinstance(parameters, Mapping):
        raise TilestampError(
            f"a table of variants names the parameters of each, such as {{ {label} = {{ tile = 8 }} }}"
        )
    return Choice({name: label}, dict(parameters))


def at_shares(name: str, axis: Axis, shares: NDArray[np.float64], whole: bool) -> list[Choice]:
    """Values of one axis of a space at shares of the way: a list in equal parts."""
    if is_range(axis):
        span = _range(axis)
        if span.points is not None:
            raise TilestampError("a range of a sample takes no points: [sample] says how many there are")
        numbers = span.at(shares)
        return [Choice({name: v}, {name: v}) for v in (map(round, numbers) if whole else numbers)]
    values = choices(name, axis, whole=whole)
    return [values[min(int(share * len(values)), len(values) - 1)] for share in shares]


def _shares(sample: Sample, dimensions: int) -> NDArray[np.float64]:
    """Points of the unit cube, (points, dimensions)."""
    import warnings

    try:
        from scipy.stats import qmc
    except ImportError:
        raise TilestampError("a sample needs scipy: python -m pip install 'tilestamp[study]'") from None
    kind = qmc.Sobol if sample.method == "sobol" else qmc.LatinHypercube
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # Sobol's balance needs a power of two: the documentation says so
        shares: NDArray[np.float64] = kind(dimensions, rng=sample.seed).random(sample.points)
    return shares
