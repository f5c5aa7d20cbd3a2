"""Small generated scenes in which everything occurs that a stage counts.

Library scenes are well-behaved: nothing crosses the eye's plane, no box spans three bins, no texture is fetched.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.geometry import Mesh, Patches
from tilestamp.simulator.scenes.pinhole import PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.splat_view import perspective
from tilestamp.simulator.scenes.splats import make_splats
from tilestamp.simulator.stages.laine2011.blend_programs import BlendProgram

IN_THE_MIDDLE = LookAt((0.0, 0.0, 1.5), (0.0, 0.0, 0.0), fov_degrees=60.0, near=0.2, far=3.0)


def textured_soup(count: int = 300) -> Scene:
    """Textured triangles of all sizes around the eye, turned and crossing; every tenth has no area.

    The first eight face the eye one before the other, each over most of the picture.
    """
    rng = np.random.default_rng(7)
    sizes = 2.0 ** rng.uniform(-6.0, 1.0, (count, 1, 1))
    points = rng.uniform(-1.4, 1.4, (count, 1, 3)) + sizes * rng.uniform(-1.0, 1.0, (count, 3, 3))
    points[::10, 2] = points[::10, 1]
    points[:8] = np.array([(-2.0, -1.5, 0.0), (2.0, -1.5, 0.0), (0.0, 2.5, 0.0)])
    points[:8, :, 2] = np.linspace(-0.8, 0.4, 8)[[[3], [5], [1], [7], [0], [2], [6], [4]]]
    positions = np.concatenate([points.reshape(-1, 3), np.ones((3 * count, 1))], axis=1).astype(np.float32)
    texture = rng.integers(0, 256, (16, 16, 4), dtype=np.uint8)
    texture[::3] = 0  # division by 255 has a path of its own for it
    uvs = rng.uniform(-1.0, 2.0, (3 * count, 2)).astype(np.float32)
    ids = np.where(np.arange(count) % 4, 0, -1).astype(np.int32)
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    mesh = Mesh(positions, triangles, uvs=uvs, texture_ids=ids, textures=(texture,))
    return Scene("textured soup", mesh=mesh, views={"default": IN_THE_MIDDLE})


def crowds() -> Scene:
    """Triangles in clip space, in crowds of 96 alike: small, large, close together, apart, behind the eye."""
    rng = np.random.default_rng(11)
    kinds = ((0.01, 0.02, 0.0), (0.01, 0.9, 0.0), (0.2, 0.9, 0.0), (0.6, 0.05, 0.0), (1.8, 0.1, 0.0), (0.3, 0.9, 0.2))
    return Scene.from_clip_space(*_joined([_crowd(rng, *kind) for kind in kinds]), name="crowds")


def _crowd(rng: np.random.Generator, size: float, spread: float, behind: float) -> NDArray[np.float64]:
    """96 triangles of one size around a place; every eighth turned away, every sixteenth thinner than a pixel."""
    corners = rng.uniform(-spread, spread, (96, 1, 2)) + size * rng.uniform(-1.0, 1.0, (96, 3, 2))
    edges = corners[:, 1:] - corners[:, :1]
    away = (edges[:, 0, 0] * edges[:, 1, 1] < edges[:, 0, 1] * edges[:, 1, 0]) ^ (np.arange(96) % 8 == 0)
    corners[away] = corners[away][:, ::-1]
    corners[::16, :, 1] *= 1e-4
    depth = rng.uniform(-0.9, 0.9, (96, 3, 1))
    w = np.ones((96, 3, 1))
    w[:, 0, 0] = np.where(rng.random(96) < behind, -0.5, 1.0)
    return np.concatenate([corners, depth, w], axis=2)


def odd_splats(count: int = 200) -> Scene:
    """Splats in front of a camera that looks along z: random ones, some too near, beside the view or too thin to see.

    Eight are slivers of determinants that round to zero or to anything: their scales hide what a pixel adds.
    """
    rng = np.random.default_rng(5)
    means = rng.uniform((-2.0, -1.5, 0.0), (2.0, 1.5, 4.0), (count, 3))
    scales, rotations = 2.0 ** rng.uniform(-7.0, -2.0, (count, 3)), rng.normal(size=(count, 4))
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    opacities = rng.uniform(0.0, 1.0, count)
    means[:8], scales[:8], rotations[:8] = (0.0, 0.0, 1.5), 0.0, (0.5, 0.0, 0.0, 0.5)
    scales[:8, 0], opacities[:8] = 2.0**14 * np.array([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7]), 0.1
    opacities[8:16], opacities[16:80] = 1e-3, 1.0
    splats = make_splats(means, scales, rotations, opacities, rng.uniform(size=(count, 3)))
    return Scene("odd splats", splats=splats, views={"default": PinholeCamera(perspective(np.eye(4), 1.0, 0.75))})


def cut_into_six() -> Scene:
    """512 triangles in clip space that the frustum cuts into five or six each: more than a ring of bin raster holds."""
    corners = np.array([(2.4, -1.9, -0.2, 1.0), (-0.4, 2.3, -1.6, 1.0), (-1.1, -0.8, 1.0, 1.0)])
    moved = corners + np.random.default_rng(13).uniform(-0.02, 0.02, (512, 3, 4)) * (1.0, 1.0, 0.1, 0.0)
    return Scene.from_clip_space(*_joined([moved]), name="cut into six")


def _joined(parts: Iterable[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    positions = np.concatenate(list(parts)).reshape(-1, 4)
    return positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3)


def patches_at_the_eye() -> Scene:
    """Patches bent, folded over themselves, turned away, off screen, and across the plane of the eye."""
    rng = np.random.default_rng(5)
    row, column = np.divmod(np.arange(16), 4)
    flat = np.stack([column / 3 - 0.5, row / 3 - 0.5, np.zeros(16)], axis=1)
    fold = np.array([0.0, 1.0, 0.2, 1.2])[column] - 0.5  # u goes out, back and out again
    nets = [
        flat + rng.uniform(-0.2, 0.2, (16, 3)),
        np.stack([fold, flat[:, 1], 0.4 * np.sin(3 * flat[:, 0])], axis=1),
        flat * np.array([-1.0, 1.0, 1.0]) + np.array([0.4, 0.3, 0.2]),
        flat + np.array([9.0, 0.0, 0.0]),
        np.stack([flat[:, 0], np.full(16, -0.3), 4.0 * flat[:, 1] + 0.5], axis=1),
        np.stack([flat[:, 0], 0.6 * flat[:, 1], 2.0 * flat[:, 1] + 1.5], axis=1),  # through the eye itself
        *(0.1 * flat + rng.uniform(-0.8, 0.8, (1, 3)) for _ in range(40)),
    ]
    points = np.concatenate([np.array(nets), np.ones((len(nets), 16, 1))], axis=2).astype(np.float32)
    return Scene("patches at the eye", Patches(points), views={"default": IN_THE_MIDDLE})


MADE = (textured_soup(), crowds(), cut_into_six(), patches_at_the_eye(), odd_splats())
GENERATED = {scene.name: scene for scene in MADE}


def brightest(pixel, color, _depth, _key):
    """A program for cudaraster's ROP: the larger of two packed colours."""
    pixel[0] = max(pixel[0], color)


BRIGHTEST = BlendProgram(brightest, operations=dict.fromkeys(("fp32", "int32", "mul32", "sfu", "control", "shared"), 1))
