"""What the experiments on sample test efficiency share: models on screen, and random polygons."""

from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from tilestamp.models.used import note
from tilestamp.simulator.scenes.camera import fit_camera
from tilestamp.simulator.scenes.catmull_clark import Surface, subdivide, surface_of
from tilestamp.simulator.scenes.library import STAND_INS
from tilestamp.simulator.scenes.quad_cage import Cage, read_cage
from tilestamp.simulator.scenes.search_path import find_scene
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons, from_surface

CUBE_CORNERS = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
CUBE_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CONFIDENCE = 0.95


class Model(NamedTuple):
    """A cage by name, and what to say where it is a stand-in."""

    name: str
    cage: Cage
    warning: str = ""

    def on_screen(self, level: int, width: int, height: int, triangles: bool = True) -> Micropolygons:
        """Subdivide, fit to the window, and give the micropolygons."""
        surface: Surface = subdivide(surface_of(self.cage), level)
        used = self.cage.positions[self.cage.corners]
        matrix = fit_camera([used.min(axis=0), used.max(axis=0)]).matrix(width, height)
        return from_surface(surface, matrix, width, height, triangles)


def cube() -> Model:
    """Give a cube of six faces."""
    return Model("cube", Cage(np.array(CUBE_CORNERS, float), np.array(CUBE_FACES).ravel(), np.full(6, 4)))


def bigguy() -> Model:
    """Give the bigguy's cage, or the cube where it is missing, with a warning."""
    path = find_scene("bigguy.obj")
    if path is None:
        note(STAND_INS, "bigguy", "bigguy.obj")
        return cube()._replace(
            name="cube (for bigguy)", warning="bigguy.obj is not on the scene path: a cube stands in"
        )
    return Model("bigguy", read_cage(path))


def random_polygons(shape: str, area: float, count: int, seed: int, pixels: int = 256) -> Micropolygons:
    """Squares or equilateral triangles of one area at random places and rotations, well inside the screen."""
    rng = np.random.default_rng(seed)
    corners = 4 if shape == "square" else 3
    turn = rng.random((count, 1)) * 2 * np.pi + 2 * np.pi * np.arange(corners) / corners
    radius = np.sqrt(2 * area / (corners * np.sin(2 * np.pi / corners)))
    centre = 32 + rng.random((count, 1, 2)) * (pixels - 64)
    vertices = np.zeros((count, corners, 3), np.float32)
    vertices[..., :2] = centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return Micropolygons(vertices, np.arange(count, dtype=np.int32), np.full(count, 160, np.uint8))


def mean_area(polygons: Micropolygons) -> float:
    """Mean area of the polygons in pixels."""
    points = polygons.vertices[..., :2].astype(np.float64)
    after = np.roll(points, -1, axis=1)
    areas = (points[..., 0] * after[..., 1] - points[..., 1] * after[..., 0]).sum(axis=1) / 2
    return float(np.abs(areas).mean())


def student(probability: float, freedom: int) -> float:
    """Quantile of Student's distribution: the normal one with two terms of its expansion (0.1 % off at 30)."""
    z = NormalDist().inv_cdf(probability)
    return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
