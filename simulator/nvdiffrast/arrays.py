"""Arguments as the kernels take them: NumPy arrays of the types and shapes that the original accepts."""

import operator
from collections.abc import Iterable
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError


class HasArray(Protocol):
    """Of another library, with ``__array__``: a torch tensor on the CPU."""

    def __array__(self) -> NDArray[Any]: ...


class HasDLPack(Protocol):
    """Of another library, with ``__dlpack__``."""

    def __dlpack__(self) -> object: ...


Array = NDArray[Any] | HasArray | HasDLPack

Faults = Literal["kept", "mended"]
"""Whether a fault of the original is reproduced (the default everywhere) or set right."""


def as_array(name: str, value: object, dtype: type[np.generic], shape: str, *dimensions: int) -> NDArray[Any]:
    """Take an argument without a copy where its memory allows.

    Parameters
    ----------
    name : str
        For the error.
    value : object
        A NumPy array, or anything on the CPU with ``__array__`` or ``__dlpack__``, such as a torch tensor.
    dtype : dtype
        Of its elements; no other is converted, as in the original.
    shape : str
        Accepted shapes in words, for the error.
    *dimensions : int
        Accepted numbers of axes.

    Returns
    -------
    ndarray
        C-contiguous. (The original refuses arrays that are not.)

    Raises
    ------
    TilestampError
        Another type, another number of axes, or no element.
    """
    if isinstance(value, np.ndarray):
        array = value
    elif hasattr(value, "__array__"):
        array = np.asarray(value.detach() if hasattr(value, "detach") else value)
    elif hasattr(value, "__dlpack__"):
        array = np.from_dlpack(value)
    else:
        raise TilestampError(f"{name} must be {np.dtype(dtype)} {shape}, not {type(value).__name__}")
    if array.dtype != dtype or array.ndim not in dimensions:
        raise TilestampError(f"{name} must be {np.dtype(dtype)} {shape}, not {array.dtype} {list(array.shape)}")
    if array.size == 0:
        raise TilestampError(f"{name} {list(array.shape)} must not be empty")
    return np.ascontiguousarray(array)


def need_axis(name: str, array: NDArray[Any], axis: int, length: int, shape: str) -> None:
    """Refuse an array of another length along an axis."""
    if array.shape[axis] != length:
        raise TilestampError(f"{name} must be {array.dtype} {shape}, not {array.dtype} {list(array.shape)}")


def as_triangles(tri: object) -> NDArray[np.int32]:
    """Take vertex indices, int32 [F, 3]; they may be out of range."""
    array = as_array("tri", tri, np.int32, "[F, 3]", 2)
    need_axis("tri", array, 1, 3, "[F, 3]")
    return array


def as_resolution(resolution: Iterable[int]) -> tuple[int, int]:
    """Height and width, whole numbers of at least 1."""
    try:
        height, width = (operator.index(n) for n in resolution)
    except (TypeError, ValueError):
        raise TilestampError(f"resolution must be (height, width), not {resolution!r}") from None
    if height < 1 or width < 1:
        raise TilestampError(f"resolution {height}x{width}: both must be at least 1")
    return height, width


def same_batch(first: int, second: int, names: str) -> None:
    """Refuse two arrays of different batches."""
    if first != second:
        raise TilestampError(f"{names} have batches of {first} and {second}")
