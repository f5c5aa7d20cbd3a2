"""Ru 2016: one thread a triangle, atomicMin on depth, an unprotected fragment write.

Modelled
--------
- One thread a triangle over its box, an atomicMin on depth, and the fragment written after it.
- The race of those writes: warps walk in step, fragments of several warps land in an order drawn by a hash (``race``).

Not modelled
------------
- When a real GPU's writes land: the places that the hash draws from are an assumption, so which pixels are wrong is
  a sample.
- Clipping: triangles with a corner behind the eye are left out, and counted.
- The time of the host's waits between launches.
"""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import Options
from tilestamp.simulator.pipelines.tiled import not_drawn
from tilestamp.simulator.scenes.clip_space import model_to_clip
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.texture import texture_chains
from tilestamp.simulator.scenes.textured_mesh import draws, geometry
from tilestamp.simulator.stages.ru2016.ambient_occlusion import ambient_occlusion
from tilestamp.simulator.stages.ru2016.clear import clear
from tilestamp.simulator.stages.ru2016.fragment_shading import Filter, fragment_shading, interpolate
from tilestamp.simulator.stages.ru2016.per_primitive_raster import per_primitive_raster
from tilestamp.simulator.stages.ru2016.tiled_raster import Visible
from tilestamp.simulator.stages.ru2016.vertex_shading import Samples, eye_space, shaded_primitives


class PerPrimitiveOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline per-primitive."""

    maps: ClassVar[dict[str, str]] = {
        "race": "pixels that unprotected writes leave wrong",
        "pixels wrong by the race": "the same",
    }
    textures: ClassVar[bool] = True
    cull_backfaces: bool = True
    """Leave out triangles that face away, as both published versions do."""
    race: bool = True
    """Show what the unprotected writes leave (by the model of ``per_primitive_raster``); false: what was meant."""
    perspective: bool = True
    """Perspective-correct interpolation."""
    texture_filter: Filter = "bilinear"
    """How textures are filtered."""
    samples: Samples = "centers"
    """Where in its pixel a sample lies: at its centre, or at its lower left corner, as in the original."""
    ssao: bool = False
    """Screen-space ambient occlusion, and its blur."""


def per_primitive(
    scene: Scene,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    options: PerPrimitiveOptions,
    execute: Executor,
) -> Frame:
    """Textured triangles by one thread each, with its write race (Ru 2016).

    Parameters
    ----------
    scene, matrix, width, height, simt, options, execute
        See ``tilestamp.simulator.pipelines``.
    """
    mesh = geometry(scene)
    matrix = model_to_clip(scene.mesh, matrix)
    chains = texture_chains(scene.mesh.textures if scene.mesh else (), mips=False)
    parts = draws(scene, mesh)
    vertices, drawable = execute(
        shaded_primitives, mesh, matrix, width, height, simt, parts, samples=options.samples
    ).outputs
    execute(clear, width, height, 0, simt)
    meant, raced = execute(
        per_primitive_raster, vertices.screen, mesh.triangles, drawable, width, height, simt,
        culling=options.cull_backfaces, textured=mesh.texture_ids >= 0,
        samples=options.samples,
    ).outputs  # fmt: skip
    dropped = len(scene.mesh.triangles) - len(drawable) if scene.mesh else 0
    wrong = raced.triangles != meant.triangles
    visible = Visible(raced.triangles, meant.depth) if options.race else meant
    fragments = interpolate(mesh, vertices, visible, perspective=options.perspective)
    light = np.ones((height, width), np.float32)
    if options.ssao:
        light = execute(ambient_occlusion, fragments, eye_space(matrix), simt, samples=options.samples).outputs
    waits = 2 * len(parts) + (5 if options.ssao else 3)  # shading and assembly of each part, raster, shading, copy
    image = execute(
        fragment_shading, mesh, chains, visible, fragments, light, simt, texture_filter=options.texture_filter
    ).outputs
    return Frame(
        image,
        meant.depth,
        execute.works,
        triangle_ids=np.where(visible.triangles >= 0, mesh.ids[visible.triangles], -1).astype(np.int32),
        maps={"race": wrong.astype(np.int64), "pixels wrong by the race": wrong.astype(np.int64)},
        facts={
            "pixels wrong by the race": int(wrong.sum()),
            "pixels drawn": int((meant.triangles >= 0).sum()),
            "launches that the host waits for": waits,
        },
        warnings=not_drawn(dropped)
        + (_raced(int(wrong.sum()), int((meant.triangles >= 0).sum())) if options.race else ()),
    )


def _raced(wrong: int, drawn: int) -> tuple[str, ...]:
    """Warn of pixels that show the wrong triangle."""
    if not wrong:
        return ()
    sentence = (
        f"{wrong:,} of {drawn:,} pixels show a triangle that is not the nearest: the fragment write is not protected "
        "(race=False draws what was meant)"
    )
    return (sentence,)
