"""What tiled and per-primitive share: options, vertices and parts of a model, the shading of what is visible."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.clip_space import model_to_clip
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.texture import texture_chains
from tilestamp.simulator.scenes.textured_mesh import Geometry, draws, geometry
from tilestamp.simulator.stages.ru2016.ambient_occlusion import ambient_occlusion
from tilestamp.simulator.stages.ru2016.fragment_shading import Filter, fragment_shading, interpolate
from tilestamp.simulator.stages.ru2016.tiled_raster import Visible
from tilestamp.simulator.stages.ru2016.vertex_shading import Samples, ShadedVertices, eye_space, shaded_primitives

DROPPED = "triangles not drawn (behind the eye, or not finite)"
WAITS = "launches that the host waits for"
REMARKS = {
    DROPPED: "{:,} triangles with a corner behind the eye, or not finite, are left out: the original cannot clip"
}


class RuOptions(Options, frozen=True, kw_only=True):
    """Options of both pipelines."""

    textures: ClassVar[bool] = True
    cull_backfaces: bool = True
    """Leave out triangles that face away, as both published versions do."""
    perspective: bool = True
    """Perspective-correct interpolation."""
    texture_filter: Filter = "bilinear"
    """How textures are filtered."""
    samples: Samples = "centers"
    """Where in its pixel a sample lies: at its centre, or at its lower left corner, as in the original."""
    ssao: bool = False
    """Screen-space ambient occlusion, and its blur."""


class Model(NamedTuple):
    """A model whose vertices are shaded."""

    mesh: Geometry
    vertices: ShadedVertices
    drawable: NDArray[np.int32]
    facts: dict[str, int]  # of its frame


def shade_vertices(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: RuOptions, execute: Executor
) -> Model:
    """Shade the vertices of each part of a model, and assemble its triangles."""
    mesh = geometry(scene)
    parts, clip = draws(scene, mesh), model_to_clip(scene.mesh, matrix)
    vertices, drawable = execute(
        shaded_primitives, mesh, clip, width, height, simt, parts, samples=options.samples
    ).outputs
    waits = 2 * len(parts) + (5 if options.ssao else 3)  # shading and assembly of each part, raster, shading, copy
    dropped = len(scene.mesh.triangles) - len(drawable) if scene.mesh else 0
    return Model(mesh, vertices, drawable, {DROPPED: dropped, WAITS: waits})


def shade_fragments(
    scene: Scene, matrix: NDArray[Any], model: Model, visible: Visible, simt: Simt, options: RuOptions,
    execute: Executor,
) -> NDArray[np.uint8]:  # fmt: skip
    """Shade what is visible, (H, W, 3), in the light that occlusion leaves where it is asked for."""
    chains = texture_chains(scene.mesh.textures if scene.mesh else (), mips=False)
    fragments = interpolate(model.mesh, model.vertices, visible, perspective=options.perspective)
    light = np.ones(visible.triangles.shape, np.float32)
    if options.ssao:
        eye = eye_space(model_to_clip(scene.mesh, matrix))
        light = execute(ambient_occlusion, fragments, eye, simt, samples=options.samples).outputs
    image: NDArray[np.uint8] = execute(
        fragment_shading, model.mesh, chains, visible, fragments, light, simt, texture_filter=options.texture_filter
    ).outputs
    return image
