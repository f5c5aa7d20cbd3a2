"""Scenes of the frontier of the methods: two waving sheets that cut through one another, of triangles of one area."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.scene import Mesh, Scene, clip_space_scene
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh, vertex_colors

SHEETS = ((17.0, 1.0, (0.95, 0.55, 0.25)), (-38.0, -1.0, (0.25, 0.55, 0.95)))  # degrees, sign of the wave, colour
JITTER = 0.18  # of a leg of a triangle, by which its corners are moved
RELIEF = 0.05  # depth of the waves, of the range -1 to 1
TEXELS = 64  # along the texture
AREAS, AREAS_LONG = (0.1, 10.0, 1000.0), (0.1, 1.0, 10.0, 100.0, 1000.0)  # pixels a triangle
SIZE, SMALL = (192, 144), (96, 72)  # pixels; the small one where triangles are smallest, and a million otherwise
LATTICE = (128, 64)  # pixels: powers of two, so that the corners are exact in clip space


@dataclass(frozen=True)
class Subject:
    """A scene at a size.

    Parameters
    ----------
    name : str
    scene : Scene
    width, height : int
        Pixels.
    matrix : ndarray, (4, 4)
        Model to clip space; the identity for what is in clip space already.
    """

    name: str
    scene: Scene
    width: int
    height: int
    matrix: NDArray[np.float64]


def subjects(areas: tuple[float, ...] = AREAS) -> list[Subject]:
    """Sheets of some areas, and a model of triangles."""
    made = []
    for area in areas:
        size = SMALL if area < 1.0 else SIZE
        made.append(Subject(f"{area:g} px", sheets(area, *size), *size, np.eye(4)))
    return [*made, Subject("teapot, triangles", real("teapot", *SIZE), *SIZE, np.eye(4))]


def patches(name: str = "teapot") -> Subject:
    """A model of patches."""
    scene = load_scene(name)
    return Subject(f"{name}, patches", scene, *SIZE, scene.views["default"].matrix(*SIZE))


def textured_subject() -> Subject:
    """The textured sheet, of triangles of 100 pixels."""
    return Subject("textured", textured(100.0, *SIZE), *SIZE, np.eye(4))


def sheets(area: float, width: int, height: int, *, count: int = 2, seed: int = 7) -> Scene:
    """Two sheets that cover the screen, each a partition of it into right triangles moved a little.

    Parameters
    ----------
    area : float
        Mean pixels a triangle.
    width, height : int
        Pixels.
    count : int
        1 for a single sheet, which covers every sample exactly once.
    seed : int
    """
    random = np.random.default_rng(seed)
    parts = [_sheet(area, width, height, *SHEETS[k], random) for k in range(count)]
    first = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    positions, colors = (np.concatenate([part[k] for part in parts]).astype(np.float32) for k in (0, 1))
    triangles = np.concatenate([part[2] + start for part, start in zip(parts, first, strict=True)])
    return _scene(f"sheets of {area:g} px", positions, triangles.astype(np.int32), colors)


def textured(area: float, width: int, height: int) -> Scene:
    """One sheet with a texture that the screen magnifies on one side and minifies on the other."""
    scene = sheets(area, width, height, count=1)
    assert scene.mesh is not None  # noqa: S101 - made just so
    mesh = scene.mesh
    x = 0.5 + 0.5 * mesh.positions[:, 0] / mesh.positions[:, 3]
    y = 0.5 - 0.5 * mesh.positions[:, 1] / mesh.positions[:, 3]
    uvs = np.stack([6.0 * x**2, 3.0 * y**2], axis=1).astype(np.float32)
    ids = np.zeros(len(mesh.triangles), np.int32)
    white = np.ones_like(mesh.colors)
    return _scene(f"textured sheet of {area:g} px", mesh.positions, mesh.triangles, white, uvs, ids, (_checker(),))


def lattice() -> Subject:
    """A flat square grid, 4 pixels a cell, whose corners are centres of pixels: every edge runs through samples."""
    width, height = LATTICE
    x, y = np.meshgrid(np.arange(-3.5, width + 4, 4), np.arange(-3.5, height + 4, 4))
    positions = np.ones((x.size, 4), np.float32)
    positions[:, 0], positions[:, 1], positions[:, 2] = 2 * x.ravel() / width - 1, 2 * y.ravel() / height - 1, 0
    triangles = grid_triangles(x.shape[1], x.shape[0])
    colors = np.ones((x.size, 4), np.float32)
    return Subject("lattice", _scene("lattice", positions, triangles, colors), width, height, np.eye(4))


def real(name: str, width: int, height: int) -> Scene:
    """A model in clip space, as float32 vertices that every pipeline gets alike, and with its vertices' colours."""
    scene = load_scene(name)
    matrix = scene.views["default"].matrix(width, height)
    mesh = triangle_mesh(scene)
    return _scene(name, clip_positions(mesh, matrix), mesh.triangles, vertex_colors(mesh, matrix))


def _sheet(
    area: float,
    width: int,
    height: int,
    degrees: float,
    sign: float,
    color: tuple[float, float, float],
    random: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Clip positions, colours and triangles of one sheet, drawn a triangle beyond the screen."""
    leg = np.sqrt(2.0 * area)
    turn = np.radians(degrees)
    rotate = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    half = np.ceil(np.hypot(width, height) / (2.0 * leg)) + 1
    steps = np.arange(-half, half + 1)
    x, y = np.meshgrid(steps, steps)
    grid = np.stack([x, y], axis=-1) + random.uniform(-JITTER, JITTER, (*x.shape, 2))
    pixels = grid @ rotate.T * leg  # from the middle of the screen
    u, v = pixels[..., 0] / width * 2.0, pixels[..., 1] / height * 2.0
    w = 1.5 + 0.4 * np.sin(1.7 * u + sign) + 0.2 * v
    z = RELIEF * sign * np.sin(5.0 * u + 2.0 * v) + 0.3 * RELIEF * np.cos(7.0 * v - u)
    clip = np.stack([u * w, v * w, z * w, w], axis=-1).reshape(-1, 4)
    light = 0.55 + 0.3 * np.cos(9.0 * u) * np.cos(9.0 * v) + random.uniform(-0.15, 0.15, u.shape)
    colors = np.concatenate([light[..., None] * np.array(color), np.ones((*u.shape, 1))], axis=-1).reshape(-1, 4)
    triangles = grid_triangles(len(steps), len(steps))
    near = np.abs(pixels.reshape(-1, 2)) <= np.array([width, height]) / 2.0 + 2.0 * leg
    kept = near.all(axis=1)[triangles].all(axis=1)
    return clip, np.clip(colors, 0.0, 1.0), triangles[kept]


def grid_triangles(columns: int, rows: int) -> NDArray[np.int32]:
    """Two counter-clockwise triangles for each cell of a grid of vertices, row by row: (T, 3) int32."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = corner, corner + 1, corner + columns, corner + columns + 1
    return np.stack([a, b, d, a, d, c], axis=1).reshape(-1, 3).astype(np.int32)


def _scene(
    name: str,
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    colors: NDArray[np.float32],
    uvs: NDArray[np.float32] | None = None,
    texture_ids: NDArray[np.int32] | None = None,
    textures: tuple[NDArray[np.uint8], ...] = (),
) -> Scene:
    """A clip-space scene whose normals face the eye, so that pipelines that light it leave its colours as they are."""
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1))
    indices = np.ascontiguousarray(triangles, np.int32)
    mesh = Mesh(positions, indices, colors, normals, True, uvs, texture_ids, textures)
    return clip_space_scene(mesh, name)


def _checker() -> NDArray[np.uint8]:
    """Coloured squares with thin lines between them, RGBA."""
    i, j = np.meshgrid(np.arange(TEXELS), np.arange(TEXELS), indexing="ij")
    square = (i // 8 + j // 8) % 2 == 0
    texture = np.full((TEXELS, TEXELS, 4), 255, np.uint8)
    texture[..., :3] = np.where(square[..., None], (240, 220, 180), (60, 90, 150))
    texture[(i % 8 == 0) | (j % 8 == 0), :3] = (20, 20, 20)
    return texture
