"""The picture that an ideal rasterizer converges to: exact coverage of side x side samples a pixel, their mean colour.

Colours are interpolated perspective-correctly in double precision and averaged as the pipelines average them, in the
values that are shown. A texture is the bilinear function of its texels (level 0), which the samples integrate: so no
mip level, and no choice of a filter, is taken for the truth.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.reference.coverage import CENTRE, Grid, cover, pixel_grid
from tilestamp.simulator.scenes.texture import add_bilinear, texture_chains

SIDE = 16  # samples along a pixel: where an edge runs along the rows, 1/32 of its contrast is left at most
_BAND = 32  # rows of pixels drawn at once, which bounds the memory


class Surface(NamedTuple):
    """What the samples show.

    Parameters
    ----------
    planes : ndarray, (F, 6, 3), float64
        Factors of x, y and 1 in red, green, blue, u, v and 1 over w, each up to the same factor.
    texture_ids : ndarray, (F,), int32
        -1 where there is none.
    background : ndarray, (3,), float64
    """

    planes: NDArray[np.float64]
    texture_ids: NDArray[np.int32]
    background: NDArray[np.float64]


@kernel
def _shade(surface: Surface, chains: Any, t: int, x: Any, y: Any, texel: Any, sample: Any) -> None:
    """Colour of triangle t at a sample."""
    planes = surface.planes
    total = planes[t, 5, 0] * x + planes[t, 5, 1] * y + planes[t, 5, 2]
    w = 1.0 / total if total != 0.0 else 0.0
    for a in range(5):
        sample[a] = (planes[t, a, 0] * x + planes[t, a, 1] * y + planes[t, a, 2]) * w
    if surface.texture_ids[t] >= 0:
        texel[:] = np.float32(0)
        add_bilinear(
            chains, surface.texture_ids[t], 0, np.float32(sample[3]), np.float32(sample[4]), np.float32(1), texel
        )
        for c in range(3):
            sample[c] *= texel[c]


@kernel
def _pixel(
    surface: Surface,
    chains: Any,
    ids: Any,
    grid: Grid,
    j: int,
    i: int,
    side: int,
    first: int,
    sample: Any,
    texel: Any,
    out: Any,
) -> None:
    """Mean of the samples of pixel (i, j) of a band whose first row of samples is ``first``."""
    red, green, blue = 0.0, 0.0, 0.0
    for b in range(j * side, (j + 1) * side):
        y = grid.y + (first + b) * grid.dy
        for a in range(i * side, (i + 1) * side):
            t = ids[b, a]
            if t < 0:
                red += surface.background[0]
                green += surface.background[1]
                blue += surface.background[2]
                continue
            _shade(surface, chains, t, grid.x + a * grid.dx, y, texel, sample)
            red += min(max(sample[0], 0.0), 1.0)
            green += min(max(sample[1], 0.0), 1.0)
            blue += min(max(sample[2], 0.0), 1.0)
    share = 1.0 / (side * side)
    out[0], out[1], out[2] = red * share, green * share, blue * share


@kernel
def _shade_part(
    part: int, parts: int, surface: Surface, chains: Any, ids: Any, grid: Grid, first_row: int, side: int, image: Any
) -> None:
    """Shade and average a part of the rows of pixels, whose first row of samples is ``first_row`` of the grid."""
    sample, texel, mean = np.empty(5), np.empty(4, np.float32), np.empty(3)
    for j in range(image.shape[0] * part // parts, image.shape[0] * (part + 1) // parts):
        for i in range(image.shape[1]):
            _pixel(surface, chains, ids, grid, j, i, side, first_row, sample, texel, mean)
            for c in range(3):
                image[j, i, c] = mean[c]


def _planes(corners: NDArray[np.float64], attributes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Planes (F, n + 1, 3) of n attributes (F, 3, n) over w, and of 1 over w."""
    edges = np.cross(np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1))
    with_one = np.concatenate([attributes, np.ones((*attributes.shape[:2], 1))], axis=2)
    planes: NDArray[np.float64] = np.ascontiguousarray(np.einsum("fka,fkx->fax", with_one, edges))
    return planes


def exact_picture(
    corners: NDArray[np.float64],
    depths: NDArray[np.float64],
    colors: NDArray[np.floating],
    width: int,
    height: int,
    *,
    side: int = SIDE,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    uvs: NDArray[np.floating] | None = None,
    texture: NDArray[np.uint8] | None = None,
    cull_backfaces: bool = False,
) -> NDArray[np.float64]:
    """Draw the converged picture.

    Parameters
    ----------
    corners, depths : ndarray, (F, 3, 3) and (F, 3), float64
        See ``homogeneous_corners`` and ``screen_corners``.
    colors : ndarray, (F, 3, 3)
        RGB in [0, 1] of the corners.
    width, height : int
        Pixels.
    side : int
        Samples along a pixel; with 1, the picture of an exact rasterizer of one sample.
    background : (float, float, float)
    uvs : ndarray, (F, 3, 2), optional
        Texture coordinates of the corners, v from the top row down; they wrap.
    texture : ndarray, (H, W, 4), uint8, optional
        Over all triangles; multiplies the colours.
    cull_backfaces : bool

    Returns
    -------
    ndarray, (height, width, 3), float64
        In [0, 1], row 0 the top row.
    """
    textured = texture is not None and uvs is not None
    attributes = np.zeros((len(corners), 3, 5))
    attributes[:, :, :3] = colors
    if textured:
        attributes[:, :, 3:] = uvs
    surface = Surface(
        _planes(corners, attributes),
        np.full(len(corners), 0 if textured else -1, np.int32),
        np.array(background, np.float64),
    )
    chains = texture_chains((texture,) if texture is not None else (), mips=False)
    image = np.zeros((height, width, 3))
    grid = pixel_grid(width, height, CENTRE, side)
    for first in range(0, height, _BAND):
        end = min(first + _BAND, height)
        seen = cover(corners, depths, grid, cull=cull_backfaces, rows=(first * side, end * side))
        band = image[first:end]
        for_parts(_shade_part, parts_of(len(band)), surface, chains, seen.ids, grid, first * side, side, band)
    return image
