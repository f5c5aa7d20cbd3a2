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
"""Whether a fault of the original is reproduced or set right."""

MOST_TRIANGLES = 2**24  # whose numbers float32 holds


def as_array(name: str, value: object, dtype: type[np.generic], shape: str, *dimensions: int) -> NDArray[Any]:
    """Take an argument, without a copy where it may be written to (kernels are not compiled twice).

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
        C-contiguous, aligned, writable.

    Raises
    ------
    TilestampError
        Another type, another number of axes, no element, not contiguous, or not on the CPU.
    """
    array = _memory_of(name, value)
    if array is None:
        raise TilestampError(f"{name} must be {np.dtype(dtype)} {shape}, not {type(value).__name__}")
    if array.dtype != dtype or array.ndim not in dimensions:
        raise TilestampError(f"{name} must be {np.dtype(dtype)} {shape}, not {array.dtype} {list(array.shape)}")
    if array.size == 0:
        raise TilestampError(f"{name} {list(array.shape)} must not be empty")
    if not array.flags.c_contiguous:
        raise TilestampError(f"{name} must be contiguous, as for the original: pass np.ascontiguousarray({name})")
    return np.require(array, requirements=["C", "A", "W"])


def _memory_of(name: str, value: object) -> NDArray[Any] | None:
    """The array of an object, None if it has none."""
    if isinstance(value, np.ndarray):
        return np.asarray(value)
    try:
        if hasattr(value, "__array__"):
            return np.asarray(value.detach() if hasattr(value, "detach") else value)
        return np.from_dlpack(value) if hasattr(value, "__dlpack__") else None
    except (TypeError, RuntimeError, BufferError, ValueError) as error:
        raise TilestampError(f"{name} cannot be read as an array on the CPU: {error}") from error


def need_axis(name: str, array: NDArray[Any], axis: int, length: int, shape: str) -> None:
    """Refuse an array of another length along an axis."""
    if array.shape[axis] != length:
        raise TilestampError(f"{name} must be {array.dtype} {shape}, not {array.dtype} {list(array.shape)}")


def as_triangles(tri: object) -> NDArray[np.int32]:
    """Take vertex indices, int32 [F, 3]; they may be out of range."""
    array = as_array("tri", tri, np.int32, "[F, 3]", 2)
    need_axis("tri", array, 1, 3, "[F, 3]")
    if len(array) > MOST_TRIANGLES:
        raise TilestampError(f"tri has {len(array)} triangles; float32 has numbers for {MOST_TRIANGLES}")
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


def are_mended(faults: str) -> bool:
    """Whether faults are to be mended; other words than the two are refused."""
    if faults not in {"kept", "mended"}:
        raise TilestampError(f"faults must be 'kept' or 'mended', not {faults!r}")
    return faults == "mended"


def same_batch(first: int, second: int, names: str) -> None:
    """Refuse two arrays of different batches."""
    if first != second:
        raise TilestampError(f"{names} have batches of {first} and {second}")
