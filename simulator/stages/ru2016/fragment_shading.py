"""Fragment shading: attributes, texture, light (Ru 2016, "Texture mapping with perspective-correct interpolation").

Perspective-correct interpolation divides each attribute by the vertex's depth in eye space (here w), interpolates on
the screen, and multiplies by the interpolated depth; the switch shows the plain screen-space version. One light at
the eye; nearest or bilinear filtering. Kernels of 8x8 threads.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.texture import TextureChains, add_bilinear, nearest
from tilestamp.simulator.scenes.textured_mesh import Geometry
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.clear import memset
from tilestamp.simulator.stages.ru2016.compiled import words
from tilestamp.simulator.stages.ru2016.fragment_shading_work import BLOCK, shading_work
from tilestamp.simulator.stages.ru2016.tiled_raster import Visible
from tilestamp.simulator.stages.ru2016.triangle import area, barycentric, corners
from tilestamp.simulator.stages.ru2016.vertex_shading import ShadedVertices
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item

AMBIENT = np.float32(0.2)
DIFFUSE = np.float32(0.8)
Filter = Literal["nearest", "bilinear"]
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


class Fragments(NamedTuple):
    """The fragment buffer.

    Parameters
    ----------
    uvs : ndarray, (H, W, 2), float32
    normals : ndarray, (H, W, 3), float32
        In eye space, unit length.
    colors : ndarray, (H, W, 3), float32
        Base colour.
    w : ndarray, (H, W), float32
        Clip w: the distance from the eye along its axis, times the matrix's factor; 0 where nothing was drawn.
    """

    uvs: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.float32]
    w: NDArray[np.float32]


@kernel(error_model="numpy", lent=True)
def weights(screen: Any, triangles: Any, t: int, px: Any, py: Any, perspective: bool) -> tuple[Any, Any, Any, Any]:
    """Weights of a triangle's corners at a point of the screen, and the interpolated w."""
    x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
    inverse = _ONE / area(x0, y0, x1, y1, x2, y2)
    a, b, c = barycentric(x0, y0, x1, y1, x2, y2, inverse, px, py)
    q0, q1, q2 = screen[triangles[t, 0], 3], screen[triangles[t, 1], 3], screen[triangles[t, 2], 3]
    w = _ONE / (a * q0 + b * q1 + c * q2)
    if perspective:
        return a * q0 * w, b * q1 * w, c * q2 * w, w
    return a, b, c, w


@kernel(error_model="numpy", lent=True)
def _interpolate_row(
    screen: Any, triangles: Any, vertex_uvs: Any, vertex_normals: Any, vertex_colors: Any, visible: Any, y: int,
    perspective: bool, uvs: Any, normals: Any, colors: Any, depths: Any,
) -> None:  # fmt: skip
    """Attributes of one row of pixels."""
    py = np.float32(y) + _HALF
    for x in range(visible.shape[1]):
        t = visible[y, x]
        if t < 0:
            continue
        a, b, c, w = weights(screen, triangles, t, np.float32(x) + _HALF, py, perspective)
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for n in range(2):
            uvs[y, x, n] = a * vertex_uvs[i, n] + b * vertex_uvs[j, n] + c * vertex_uvs[k, n]
        length = _ZERO
        for n in range(3):
            colors[y, x, n] = a * vertex_colors[i, n] + b * vertex_colors[j, n] + c * vertex_colors[k, n]
            normals[y, x, n] = a * vertex_normals[i, n] + b * vertex_normals[j, n] + c * vertex_normals[k, n]
            length += normals[y, x, n] * normals[y, x, n]
        if length > _ZERO:
            for n in range(3):
                normals[y, x, n] /= np.sqrt(length)
        depths[y, x] = w


@kernel(error_model="numpy", lent=True)
def _interpolate(
    part: int, parts: int, screen: Any, triangles: Any, vertex_uvs: Any, vertex_normals: Any, vertex_colors: Any,
    visible: Any, perspective: bool, uvs: Any, normals: Any, colors: Any, depths: Any,
) -> None:  # fmt: skip
    """Attributes of a share of the rows."""
    for y in range(part * len(visible) // parts, (part + 1) * len(visible) // parts):
        _interpolate_row(
            screen, triangles, vertex_uvs, vertex_normals, vertex_colors, visible, y,
            perspective, uvs, normals, colors, depths,
        )  # fmt: skip


def interpolate(mesh: Geometry, vertices: ShadedVertices, visible: Visible, *, perspective: bool = True) -> Fragments:
    """Interpolate the attributes of every visible fragment.

    Parameters
    ----------
    mesh : Geometry
    vertices : ShadedVertices
    visible : Visible
    perspective : bool
        Perspective-correct, or linear on the screen.
    """
    shape = visible.triangles.shape
    uvs, normals, colors = (np.zeros((*shape, n), np.float32) for n in (2, 3, 3))
    fragments = Fragments(uvs, normals, colors, np.zeros(shape, np.float32))
    for_parts(
        _interpolate, parts_of(shape[0]), vertices.screen, mesh.triangles, mesh.uvs, vertices.normals, mesh.colors,
        visible.triangles, perspective, *fragments,
    )  # fmt: skip
    return fragments


@kernel(error_model="numpy")
def _shade_row(
    visible: Any, texture_ids: Any, chains: Any, bilinear: bool, uvs: Any, normals: Any, colors: Any, light: Any,
    y: int, out: Any,
) -> None:  # fmt: skip
    """Colours of one row of pixels."""
    texel = np.zeros(4, np.float32)
    for x in range(visible.shape[1]):
        t = visible[y, x]
        if t < 0:
            continue
        texel[:] = _ONE
        if texture_ids[t] >= 0 and bilinear:
            texel[:] = _ZERO
            add_bilinear(chains, texture_ids[t], 0, uvs[y, x, 0], uvs[y, x, 1], _ONE, texel)
        elif texture_ids[t] >= 0:
            nearest(chains, texture_ids[t], uvs[y, x, 0], uvs[y, x, 1], texel)
        shade = (AMBIENT + DIFFUSE * abs(normals[y, x, 2])) * light[y, x]
        for c in range(3):
            value = colors[y, x, c] * texel[c] * shade
            out[y, x, c] = np.uint8(min(max(value, _ZERO), _ONE) * np.float32(255.0) + _HALF)


@kernel(error_model="numpy", lent=True)
def _shade(
    part: int, parts: int, visible: Any, texture_ids: Any, chains: Any, bilinear: bool, uvs: Any, normals: Any,
    colors: Any, light: Any, out: Any,
) -> None:  # fmt: skip
    """Colours of a share of the rows."""
    for y in range(part * len(visible) // parts, (part + 1) * len(visible) // parts):
        _shade_row(visible, texture_ids, chains, bilinear, uvs, normals, colors, light, y, out)


def fragment_shading(
    mesh: Geometry,
    chains: TextureChains,
    visible: Visible,
    fragments: Fragments,
    light: NDArray[np.float32],
    simt: Simt,
    *,
    texture_filter: Filter,
) -> StageResult[NDArray[np.uint8]]:
    """Clear the colours, shade every fragment, and copy the colours to the window's buffer.

    Parameters
    ----------
    mesh : Geometry
    chains : TextureChains
    visible : Visible
    fragments : Fragments
    light : ndarray, (H, W), float32
        Share of the light that ambient occlusion leaves.
    simt : Simt
    texture_filter : {"nearest", "bilinear"}

    Returns
    -------
    outputs : ndarray, (H, W, 3), uint8
        The picture.
    works : the clear, the shading kernel and the copy
    """
    height, width = visible.triangles.shape
    image = np.zeros((height, width, 3), np.uint8)
    bilinear = texture_filter == "bilinear"
    for_parts(
        _shade, parts_of(height), visible.triangles, mesh.texture_ids, chains, bilinear, *fragments[:3], light, image
    )
    pixels = width * height
    colors = Access("colors", 12, 3)
    window = tuple(Access("window", 4, 1, word_bytes=bytes_) for bytes_ in words(simt).window)
    drawn = visible.triangles >= 0
    textures = np.where(drawn, mesh.texture_ids[visible.triangles], np.int32(-1))
    works = (
        memset("colors", 3 * pixels, simt),
        shading_work(drawn, textures, fragments.uvs, chains, texture_filter, simt),
        thread_per_item("copy", "copy", pixels, BLOCK, simt, (colors,), window),
    )
    return StageResult(image, works)
