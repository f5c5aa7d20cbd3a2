"""Splats: 3D Gaussians, as the published tile rasterizer takes them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError

HARMONICS = (0, 3, 8, 15)  # coefficients a colour beyond the first, by degree


@dataclass(frozen=True, eq=False)
class Splats:
    """3D Gaussians; all arrays float32, C order, taken as they are.

    Parameters
    ----------
    means : ndarray, (N, 3)
    scales : ndarray, (N, 3)
        Standard deviations along the own axes, in units of the scene.
    rotations : ndarray, (N, 4)
        Quaternions w x y z; nothing normalizes them.
    opacities : ndarray, (N,)
    colours : ndarray, (N, 3)
        Red, green, blue; where there are ``harmonics``, 0.5 and the constant term of each.
    harmonics : ndarray, (N, K, 3), or None
        Coefficients of spherical harmonics of the degrees from 1 on, 3, 8 or 15: colours depend on the direction.
    """

    means: NDArray[np.float32]
    scales: NDArray[np.float32]
    rotations: NDArray[np.float32]
    opacities: NDArray[np.float32]
    colours: NDArray[np.float32]
    harmonics: NDArray[np.float32] | None = None

    def __len__(self) -> int:
        return len(self.means)

    @property
    def degree(self) -> int:
        """Of the spherical harmonics, 0 to 3."""
        return 0 if self.harmonics is None else HARMONICS.index(self.harmonics.shape[1])


def make_splats(
    means: ArrayLike,
    scales: ArrayLike,
    rotations: ArrayLike,
    opacities: ArrayLike,
    colours: ArrayLike,
    harmonics: ArrayLike | None = None,
) -> Splats:
    """Make splats of anything that can be such arrays.

    Raises
    ------
    TilestampError
        Arrays that do not fit together, that are no numbers, or no Gaussian at all.
    """
    given = {"means": (means, 3), "scales": (scales, 3), "rotations": (rotations, 4), "opacities": (opacities, 0)}
    given["colours"] = (colours, 3)
    arrays = {name: _array(name, values, columns) for name, (values, columns) in given.items()}
    counts = {name: len(array) for name, array in arrays.items()}
    if len(set(counts.values())) > 1:
        raise TilestampError("splats: " + ", ".join(f"{count} {name}" for name, count in counts.items()) + " differ")
    if not len(arrays["means"]):
        raise TilestampError("splats: there are none")
    return Splats(**arrays, harmonics=None if harmonics is None else _harmonics(harmonics, len(arrays["means"])))


def _array(name: str, values: ArrayLike, columns: int) -> NDArray[np.float32]:
    try:
        array = np.ascontiguousarray(values, np.float32)
    except (TypeError, ValueError):
        raise TilestampError(f"splats: {name} are not made of numbers") from None
    if name == "opacities" and array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim != (2 if columns else 1) or (columns and array.shape[1] != columns):
        raise TilestampError(f"splats: {name} must be (N{f', {columns}' if columns else ','}), not {array.shape}")
    return array


def _harmonics(values: ArrayLike, count: int) -> NDArray[np.float32]:
    array = np.ascontiguousarray(values, np.float32)
    if array.ndim != 3 or array.shape[::2] != (count, 3) or array.shape[1] not in HARMONICS[1:]:
        raise TilestampError(f"splats: harmonics must be ({count}, 3, 8 or 15, 3), not {array.shape}")
    return array
