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
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.options import Options
from tilestamp.simulator.scenes.clip_space import model_to_clip
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.texture import texture_chains
from tilestamp.simulator.scenes.textured_mesh import draws, geometry
from tilestamp.simulator.stages.ru2016.ambient_occlusion import ambient_occlusion
from tilestamp.simulator.stages.ru2016.clear import clear
from tilestamp.simulator.stages.ru2016.fragment_shading import Filter, fragment_shading, interpolate
from tilestamp.simulator.stages.ru2016.tile_lists import Capacity, tile_lists
from tilestamp.simulator.stages.ru2016.tiled_raster import TiledRasterEvent, raster_work, tiled_raster
from tilestamp.simulator.stages.ru2016.vertex_shading import Samples, eye_space, shaded_primitives
from tilestamp.simulator.work import Work


class TiledOptions(Options, frozen=True, kw_only=True):
    """Options of the pipeline tiled."""

    maps: ClassVar[dict[str, str]] = {
        "tests": "sample tests in a tile",
        "ste": "sample test efficiency in a tile",
        "atomics": "atomics on a tile's list",
        "list length": "triangles in a tile's list",
    }
    textures: ClassVar[bool] = True
    tile: Annotated[int, Meta(ge=4, le=32)] = 8
    """Pixels on a side of a tile; a block has a thread for each."""
    cull_backfaces: bool = True
    """Leave out triangles that face away."""
    capacity: Capacity = "safe"
    """Count, scan and fill the lists; or the original's room of a tenth of all triangles, which can overflow."""
    perspective: bool = True
    """Perspective-correct interpolation."""
    texture_filter: Filter = "bilinear"
    """How textures are filtered."""
    samples: Samples = "centers"
    """Where in its pixel a sample lies: at its centre, or at its lower left corner, as in the original."""
    ssao: bool = False
    """Screen-space ambient occlusion, and its blur."""

    def launches(self, simt: Simt) -> list[Work]:  # noqa: ARG002 - on every machine alike
        """Tiled raster has a thread a pixel of a tile."""
        return [raster_work(np.zeros((0, len(TiledRasterEvent)), np.int64), self.tile)]


def tiled(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, simt: Simt, options: TiledOptions, execute: Executor
) -> Frame:
    """Textured triangles by tile lists, a thread a pixel (Ru 2016).

    Parameters
    ----------
    scene, matrix, width, height, simt, options, execute
        See ``tilestamp.simulator.pipelines``.
    """
    tile = options.tile
    mesh = geometry(scene)
    matrix = model_to_clip(scene.mesh, matrix)
    chains = texture_chains(scene.mesh.textures if scene.mesh else (), mips=False)
    tiles = -(-width // tile) * -(-height // tile)
    parts = draws(scene, mesh)
    vertices, drawable = execute(
        shaded_primitives, mesh, matrix, width, height, simt, parts, samples=options.samples
    ).outputs
    execute(clear, width, height, tiles, simt)
    lists, _, listed = execute(
        tile_lists,
        vertices.screen,
        mesh.triangles,
        drawable,
        width,
        height,
        simt,
        tile=tile,
        culling=options.cull_backfaces,
        capacity=options.capacity,
    )
    visible, (raster,), _ = execute(
        tiled_raster, vertices.screen, mesh.triangles, lists, width, height, simt, tile=tile, gaps=not options.ssao
    )
    fragments = interpolate(mesh, vertices, visible, perspective=options.perspective)
    light = np.ones((height, width), np.float32)
    if options.ssao:
        light = execute(ambient_occlusion, fragments, eye_space(matrix), simt, samples=options.samples).outputs
    waits = 2 * len(parts) + (5 if options.ssao else 3)  # shading and assembly of each part, raster, shading, copy
    image = execute(
        fragment_shading, mesh, chains, visible, fragments, light, simt, texture_filter=options.texture_filter
    ).outputs
    sizes, lost = np.diff(lists.starts), listed["lost"]
    dropped = len(scene.mesh.triangles) - len(drawable) if scene.mesh else 0
    return Frame(
        image,
        visible.depth,
        execute.works,
        triangle_ids=np.where(visible.triangles >= 0, mesh.ids[visible.triangles], -1).astype(np.int32),
        maps=_maps(sizes, raster, -(-height // tile)),
        facts={
            "tile": tile,
            "list entries": int(sizes.sum()),
            "longest list": int(sizes.max()),
            "list entries lost by overflow": lost,
            "triangles not drawn (behind the eye, or not finite)": dropped,
            "launches that the host waits for": waits,
        },
        warnings=not_drawn(dropped) + _overflow(lost, int(sizes.sum())),
        tile=tile,
    )


def _maps(sizes: NDArray[np.int64], raster: Work, rows: int) -> dict[str, NDArray[Any]]:
    """Heat maps: a cell a tile."""
    tests, hits = (raster.table[:, event] for event in (TiledRasterEvent.SAMPLE_TESTS, TiledRasterEvent.SAMPLE_HITS))
    ste = np.divide(hits, tests, out=np.zeros(len(tests)), where=tests > 0)
    maps = {"tests": tests, "ste": ste, "atomics": sizes, "list length": sizes}
    return {name: counts.reshape(rows, -1) for name, counts in maps.items()}


def not_drawn(dropped: int) -> tuple[str, ...]:
    """Warn of triangles that the original cannot draw."""
    if not dropped:
        return ()
    return (
        f"{dropped:,} triangles with a corner behind the eye, or not finite, are left out: the original cannot clip",
    )


def _overflow(lost: int, kept: int) -> tuple[str, ...]:
    """Warn of list entries that found no room."""
    if not lost:
        return ()
    sentence = (
        f"{lost:,} of {lost + kept:,} list entries found no room and are not drawn, where the original would have "
        "written into the next list: capacity=safe has room for all"
    )
    return (sentence,)
