"""The garden of gsplat's profiler: points of a photographed scene with random covariances, on a grid of copies.

Points and cameras are those of test_garden.npz (nerfstudio-project/gsplat, Apache-2.0), which is looked for on the
scene search path; ``garden1``, ``garden5``, ``garden21``... are 1, 25, 441 copies of the 111,785 points of a cube of 4.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.pinhole import Pinhole, PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.splat_view import perspective
from tilestamp.simulator.scenes.splats import Splats

FILE = "test_garden.npz"
HALF_SIDE = 2.0  # of the cube that is kept
SCALES = (1e-4, 0.02)  # of the Gaussians, uniform
SEED = 0
_PART = 1 << 20  # Gaussians at a time


@dataclass(frozen=True, eq=False)
class GardenView:
    """A camera of the file, on a screen of any size: as wide and as high as the photograph sees."""

    view: NDArray[np.float64]  # (4, 4)
    focal: tuple[float, float]  # pixels of the photograph
    size: tuple[int, int]  # of the photograph

    def pinhole_for(self, width: int, height: int) -> Pinhole:
        """The camera, rounded as the measured program's."""
        x, y = self.focal[0] * width / self.size[0], self.focal[1] * height / self.size[1]
        return perspective(self.view, width / (2 * x), height / (2 * y))

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Model-to-clip matrix of y up, (4, 4) float64."""
        return PinholeCamera(self.pinhole_for(width, height)).matrix(width, height)


def garden_copies(name: str) -> int:
    """Copies on a side of the grid that a name such as ``garden5`` means; 0 where it is none."""
    found = re.fullmatch(r"garden(\d{1,3})", name)
    return int(found[1]) if found and int(found[1]) % 2 else 0


def garden(path: Path, copies: int) -> Scene:
    """Make the scene of an odd number of copies on a side."""
    with np.load(path, allow_pickle=False) as file:
        points, colours = file["means3d"].astype(np.float32), (file["colors"] / 255.0).astype(np.float32)
        views, lenses = file["viewmats"].astype(np.float64), file["Ks"].astype(np.float64)
        size = (int(file["width"]), int(file["height"]))
    kept = (np.abs(points) <= HALF_SIDE).all(axis=1)
    if not kept.any():
        raise TilestampError(f"{path}: has no point in the cube of the garden")
    points, colours = points[kept], colours[kept]
    half = copies // 2
    places = [(x, y, 0) for x in range(-half, half + 1) for y in range(-half, half + 1)]
    offsets = np.array(places, np.float32) * np.float32(2 * HALF_SIDE)
    means = (points[None] + offsets[:, None]).reshape(-1, 3)
    seen = {
        f"camera{k}": GardenView(view, (float(lens[0, 0]), float(lens[1, 1])), size)
        for k, (view, lens) in enumerate(zip(views, lenses, strict=True))
    }
    splats = _random(means, np.tile(colours, (len(offsets), 1)))
    return Scene(f"garden{copies}", splats=splats, views={"default": seen["camera0"], **seen})


def _random(means: NDArray[np.float32], colours: NDArray[np.float32]) -> Splats:
    """Random scales, rotations and opacities, drawn in this order."""
    count, draw = len(means), np.random.default_rng(SEED)
    scales, rotations = np.empty((count, 3), np.float32), np.empty((count, 4), np.float32)
    parts = [slice(first, min(first + _PART, count)) for first in range(0, count, _PART)]
    for part in parts:
        scales[part] = draw.random((part.stop - part.start, 3)) * (SCALES[1] - SCALES[0]) + SCALES[0]
    for part in parts:
        turned = draw.standard_normal((part.stop - part.start, 4))
        rotations[part] = turned / np.sqrt((turned * turned).sum(axis=1))[:, None]
    opacities = draw.random(count).astype(np.float32)
    return Splats(means, scales, rotations, opacities, colours)
