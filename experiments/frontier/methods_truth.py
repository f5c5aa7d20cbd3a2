"""The exact answer for a scene, made once for each place of a sample and for each way of shading."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.frontier.methods_scenes import Subject
from tilestamp.experiments.frontier.methods_variants import Variant
from tilestamp.experiments.frontier.picture_error import flip
from tilestamp.models.machine import load_machine
from tilestamp.simulator.reference.coverage import CENTRE, Visible, homogeneous_corners, screen_corners, visibility
from tilestamp.simulator.reference.picture import exact_picture
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import BACKGROUND
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS, sample_positions
from tilestamp.simulator.stages.laine2011.coverage import SAMPLE_COLUMN, shown_sample

MICROPOLYGONS = ("stamps", "across-polygons", "bit-mask")  # white behind, a grey a polygon
FINE_BOUND = 2.0  # pixels of a sub-patch of the reference: its micropolygons are two thirds of a pixel
FINE_EDGE = 0.7  # pixels of a micropolygon of the reference
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
QUICK_SIDE = 8  # samples along a pixel of the converged picture; a mean of 4e-5 from that of 16 on the sheets


@dataclass(frozen=True)
class Geometry:
    """Triangles of a reference.

    Parameters
    ----------
    corners, depths : ndarray, (F, 3, 3) and (F, 3), float64
    colors : ndarray, (F, 3, 3), float64
    ids : ndarray, (F,), int32, or None
        What a pipeline calls each triangle, where it says what it drew.
    background : (float, float, float)
    """

    corners: NDArray[np.float64]
    depths: NDArray[np.float64]
    colors: NDArray[np.float64]
    ids: NDArray[np.int32] | None
    background: tuple[float, float, float]


@dataclass
class Truth:
    """Exact answers for one scene, kept."""

    subject: Subject
    side: int = QUICK_SIDE
    _geometries: dict[str, Geometry] = field(default_factory=dict)
    _seen: dict[tuple[str, tuple[float, float]], Visible] = field(default_factory=dict)
    _pictures: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    _flips: dict[tuple[str, bytes], float] = field(default_factory=dict)

    def geometry(self, pipeline: str) -> Geometry:
        """Triangles that ``pipeline`` ought to draw, in its own shading."""
        kind = _kind(self.subject, pipeline)
        if kind not in self._geometries:
            self._geometries[kind] = _MAKERS[kind](self.subject)
        return self._geometries[kind]

    def visible(self, variant: Variant) -> Visible:
        """What the sample sees whose triangle the variant reports, by triangles of its geometry."""
        kind, offset = _kind(self.subject, variant.pipeline), shown_offset(variant)
        if (kind, offset) not in self._seen:
            made = self.geometry(variant.pipeline)
            size = self.subject.width, self.subject.height
            self._seen[kind, offset] = visibility(made.corners, made.depths, *size, offset=offset)
        return self._seen[kind, offset]

    def picture(self, pipeline: str) -> NDArray[np.float64]:
        """The converged picture."""
        kind = _kind(self.subject, pipeline)
        if kind not in self._pictures:
            made, mesh = self.geometry(pipeline), self.subject.scene.mesh
            texture: dict[str, Any] = {}
            if mesh is not None and mesh.textures and mesh.uvs is not None:
                texture = {"uvs": mesh.uvs[mesh.triangles], "texture": mesh.textures[0]}
            self._pictures[kind] = exact_picture(
                made.corners, made.depths, made.colors, self.subject.width, self.subject.height,
                side=self.side, background=made.background, **texture,
            )  # fmt: skip
        return self._pictures[kind]

    def flip(self, pipeline: str, image: NDArray[np.uint8]) -> float:
        """FLIP error of an image; that of one seen before is known."""
        key = _kind(self.subject, pipeline), image.tobytes()
        if key not in self._flips:
            self._flips[key] = flip(self.picture(pipeline), image)
        return self._flips[key]


def shown_offset(variant: Variant) -> tuple[float, float]:
    """Where in its pixel the sample lies whose triangle a pipeline reports, from the top left corner."""
    if variant.pipeline in MICROPOLYGONS:
        x, y = sample_positions(variant.options.get("spp", 1))[0] / SUBPIXELS
        return float(x), float(y)
    samples = variant.options.get("msaa", 1)
    if samples == 1:
        return CENTRE
    row = shown_sample(samples)  # rows go up
    column = int(SAMPLE_COLUMN[samples.bit_length() - 1, row])
    return (2 * column + 1) / (2 * samples), 1.0 - (2 * row + 1) / (2 * samples)


def _kind(subject: Subject, pipeline: str) -> str:
    if pipeline in MICROPOLYGONS:
        return "flat patches" if subject.scene.patches is not None else "flat triangles"
    return "patches" if subject.scene.patches is not None else "triangles"


def _triangles(subject: Subject) -> Geometry:
    """The scene's own triangles in the colours of their vertices."""
    mesh = subject.scene.mesh
    assert mesh is not None and mesh.colors is not None  # noqa: S101, PT018 - made by methods_scenes
    corners, depths = homogeneous_corners(mesh.positions, mesh.triangles, subject.width, subject.height)
    ids = np.arange(len(mesh.triangles), dtype=np.int32)
    return Geometry(corners, depths, mesh.colors[mesh.triangles][..., :3].astype(np.float64), ids, BLACK)


def _flat_triangles(subject: Subject) -> Geometry:
    """The scene's own triangles, each in the grey that the micropolygon rasterizers give it."""
    made, drawn = _triangles(subject), micropolygons(subject.scene, np.eye(4), subject.width, subject.height)
    grey = np.zeros(len(made.corners))
    grey[drawn.patch] = drawn.shade / 255.0
    return Geometry(made.corners, made.depths, _same(grey), made.ids, WHITE)


def _flat_patches(subject: Subject) -> Geometry:
    """Patches diced finer than a pixel in double precision, each micropolygon in its grey."""
    size = subject.width, subject.height
    fine = micropolygons(subject.scene, subject.matrix, *size, FINE_EDGE, triangles=True)
    vertices = fine.vertices.astype(np.float64)
    vertices[..., 2] = 2.0 * vertices[..., 2] - 1.0
    return Geometry(*screen_corners(vertices, *size), _same(fine.shade / 255.0), fine.patch, WHITE)


def _patches(subject: Subject) -> Geometry:
    """Patches diced finer than a pixel by the pipeline's own stage, in the colours that it gives the vertices."""
    patches = subject.scene.patches
    assert patches is not None  # noqa: S101 - chosen by kind
    size, simt = (subject.width, subject.height), load_machine("h200").simt
    parts, _, _ = bound_and_split(patches.points, subject.matrix, *size, FINE_BOUND, simt, counting=False)
    grids, _, _ = dice(patches.points, parts, subject.matrix, *size, simt, counting=False)
    corner = np.arange(12).reshape(3, 4)[:, :3].ravel()
    halves = np.stack([corner, corner + 1, corner + 5, corner, corner + 5, corner + 4], axis=1).reshape(-1, 3)
    vertices = grids.vertices[:, halves].reshape(-1, 3, 4)
    packed = np.ascontiguousarray(vertices[..., 3])
    colors = packed.view(np.uint8).reshape(-1, 3, 4)[..., :3] / 255.0
    behind = np.array([BACKGROUND], np.uint32).view(np.uint8)[:3] / 255.0
    background = float(behind[0]), float(behind[1]), float(behind[2])
    return Geometry(*screen_corners(vertices[..., :3], *size), colors, None, background)


def _same(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """One grey for all corners and colours."""
    return np.repeat(grey, 9).reshape(-1, 3, 3)


_MAKERS = {
    "triangles": _triangles,
    "flat triangles": _flat_triangles,
    "patches": _patches,
    "flat patches": _flat_patches,
}
