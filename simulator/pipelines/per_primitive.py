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
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.pipelines._ru import REMARKS as RU_REMARKS
from tilestamp.simulator.pipelines._ru import RuOptions, shade_fragments, shade_vertices
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.textured_mesh import input_ids
from tilestamp.simulator.stages.ru2016.clear import clear
from tilestamp.simulator.stages.ru2016.per_primitive_raster import per_primitive_raster
from tilestamp.simulator.stages.ru2016.tiled_raster import Visible

RACED = "pixels wrong by the race"
REMARKS = {
    RACED: "{:,} of {pixels drawn:,} pixels show a triangle that is not the nearest: the fragment write is not "
    "protected (race=False draws what was meant)"
}


class PerPrimitiveOptions(RuOptions, frozen=True, kw_only=True):
    """Options of the pipeline per-primitive."""

    maps: ClassVar[dict[str, str]] = {"race": "pixels that unprotected writes leave wrong", RACED: "the same"}
    race: bool = True
    """Show what the unprotected writes leave (by the model of ``per_primitive_raster``); false: what was meant."""


def per_primitive(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: PerPrimitiveOptions,
    execute: Executor,
) -> Frame:  # fmt: skip
    """Textured triangles by one thread each, with its write race (Ru 2016)."""
    model = shade_vertices(scene, matrix, width, height, simt, options, execute)
    execute(clear, width, height, 0, simt)
    meant, raced = execute(
        per_primitive_raster, model.vertices.screen, model.mesh.triangles, model.drawable, width, height, simt,
        culling=options.cull_backfaces, textured=model.mesh.texture_ids >= 0, samples=options.samples,
    ).outputs  # fmt: skip
    visible = Visible(raced.triangles, meant.depth) if options.race else meant
    image = shade_fragments(scene, matrix, model, visible, simt, options, execute)
    wrong = (raced.triangles != meant.triangles).astype(np.int64)
    facts = {RACED: int(wrong.sum()), "pixels drawn": int((meant.triangles >= 0).sum()), **model.facts}
    said = remarks(RU_REMARKS, facts) + (remarks(REMARKS, facts) if options.race else ())
    ids = input_ids(model.mesh, visible.triangles)
    return Frame(image, meant.depth, execute.works, ids, {"race": wrong, RACED: wrong}, facts, said)
