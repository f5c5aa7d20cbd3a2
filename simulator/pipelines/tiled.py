"""Ru 2016: triangles listed by tile, one block a tile, one thread a pixel.

Modelled
--------
- Vertex shading and assembly for each part of the model, clears, lists by tile, raster, shading with textures,
  ambient occlusion and its blur, copy to the screen.
- The original's lists with room for a tenth of all triangles, which overflow (``capacity``), beside safe ones.
- The wait of the host after each launch, as the fact ``launches that the host waits for``.

Not modelled
------------
- Clipping: as in the original, triangles with a corner behind the eye are left out, and counted.
- The time of those waits: experiments add it where a published frame has it.
- Whose views and GPUs the published times are: partly unknown, so their frames come out within a factor of two.
"""

from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.pipelines._ru import REMARKS as RU_REMARKS
from tilestamp.simulator.pipelines._ru import RuOptions, shade_fragments, shade_vertices
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.textured_mesh import input_ids
from tilestamp.simulator.stages.ru2016.clear import clear
from tilestamp.simulator.stages.ru2016.tile_lists import Capacity, tile_lists
from tilestamp.simulator.stages.ru2016.tiled_raster import TiledRasterEvent, raster_work, tiled_raster
from tilestamp.simulator.work import Work

LOST = "list entries lost by overflow"
REMARKS = RU_REMARKS | {
    LOST: "{:,} list entries, beside {list entries:,} others, found no room and are not drawn, where the original "
    "would have written into the next list: capacity=safe has room for all"
}


class TiledOptions(RuOptions, frozen=True, kw_only=True):
    """Options of the pipeline tiled."""

    maps: ClassVar[dict[str, str]] = {
        "tests": "sample tests in a tile",
        "ste": "sample test efficiency in a tile",
        "atomics": "atomics on a tile's list",
        "list length": "triangles in a tile's list",
    }
    tile: Annotated[int, Meta(ge=4, le=32)] = 8
    """Pixels on a side of a tile; a block has a thread for each."""
    capacity: Capacity = "safe"
    """Count, scan and fill the lists; or the original's room of a tenth of all triangles, which can overflow."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """Tiled raster has a thread a pixel of a tile."""
        return [raster_work(np.zeros((0, len(TiledRasterEvent)), np.int64), self.tile)]


def tiled(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: TiledOptions, execute: Executor
) -> Frame:
    """Textured triangles by tile lists, a thread a pixel (Ru 2016)."""
    tile = options.tile
    model = shade_vertices(scene, matrix, width, height, simt, options, execute)
    execute(clear, width, height, -(-width // tile) * -(-height // tile), simt)
    lists, _, listed = execute(
        tile_lists, model.vertices.screen, model.mesh.triangles, model.drawable, width, height, simt,
        tile=tile, culling=options.cull_backfaces, capacity=options.capacity,
    )  # fmt: skip
    visible, (raster,), _ = execute(
        tiled_raster, model.vertices.screen, model.mesh.triangles, lists, width, height, simt,
        tile=tile, gaps=not options.ssao,
    )  # fmt: skip
    image = shade_fragments(scene, matrix, model, visible, simt, options, execute)
    sizes = np.diff(lists.starts)
    facts = {
        "tile": tile, "list entries": int(sizes.sum()), "longest list": int(sizes.max()), LOST: listed["lost"],
        **model.facts,
    }  # fmt: skip
    return Frame(
        image, visible.depth, execute.works, input_ids(model.mesh, visible.triangles),
        _maps(sizes, raster, -(-height // tile)), facts, remarks(REMARKS, facts), tile,
    )  # fmt: skip


def _maps(sizes: NDArray[np.int64], raster: Work, rows: int) -> dict[str, NDArray[Any]]:
    """Heat maps: a cell a tile."""
    tests, hits = (raster.table[:, event] for event in (TiledRasterEvent.SAMPLE_TESTS, TiledRasterEvent.SAMPLE_HITS))
    ste = np.divide(hits, tests, out=np.zeros(len(tests)), where=tests > 0)
    maps = {"tests": tests, "ste": ste, "atomics": sizes, "list length": sizes}
    return {name: counts.reshape(rows, -1) for name, counts in maps.items()}
