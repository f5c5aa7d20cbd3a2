"""How far a picture is off: pixels of the wrong triangle, holes, depth in units of the last place, FLIP for the eye."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.reference.coverage import Visible
from tilestamp.simulator.stages.depth_format import DEPTHS
from tilestamp.simulator.stages.zhang2025.depth import DEPTH_STEPS

CLEARLY_BEHIND = 1e-3  # of the depth range from -1 to 1: far more than any depth format here cannot tell apart
CUDARASTER = (2147483648.0, 2147465984.0)  # depth of z / w = 0, and how far 1 lies from it (triangle setup)
FREEPIPE = 2.0**32 - 256
WORD_BITS = 12  # below the depth in a word of FreePipe's packing "32"
PER_PRIMITIVE = 2.0**31 - 1


class PixelErrors(NamedTuple):
    """Shares of all pixels.

    Parameters
    ----------
    wrong : float
        Another triangle than the exact one, or one where there is none, or none where there is one.
    holes : float
        Nothing, or a surface clearly behind, where there is a nearer one: what shines through.
    spills : float
        A triangle where there is none, or one that is clearly nearer than what should be seen.
    """

    wrong: float
    holes: float
    spills: float


def pixel_errors(
    ids: NDArray[np.int32], truth: Visible, corners: NDArray[np.float64], depths: NDArray[np.float64]
) -> PixelErrors:
    """Compare the triangles seen with those of an exact rasterizer at the same samples.

    Parameters
    ----------
    ids : ndarray, (H, W), int32
        Row 0 is the top row, -1 where nothing was drawn.
    truth : Visible
    corners, depths : ndarray
        See ``homogeneous_corners``.
    """
    wrong = ids != truth.ids
    least, greatest = corner_depths(corners, depths)
    behind, before = least[ids] > truth.depth + CLEARLY_BEHIND, greatest[ids] < truth.depth - CLEARLY_BEHIND
    return PixelErrors(float(wrong.mean()), float((wrong & behind).mean()), float((wrong & before).mean()))


def corner_depths(
    corners: NDArray[np.float64], depths: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest depth of each triangle's corners, and at the end those of nothing: infinitely far.

    A neighbour that reaches over an edge by a fraction of a pixel has a corner as near, and one as far, as what it
    covers, whatever its plane says out there; a surface behind or before has not.
    """
    deep = depths / corners[:, :, 2]
    return np.append(deep.min(axis=1), np.inf), np.append(deep.max(axis=1), np.inf)


def depth_errors(
    pipeline: str, options: dict[str, Any], stored: NDArray[Any], z: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depths' errors in units of the last place of the pipeline's own format.

    Parameters
    ----------
    pipeline : str
    options : dict
        Its options, where they choose the format.
    stored : ndarray, (n,)
        As the pipeline keeps them.
    z : ndarray, (n,), float64
        Exact z / w, -1 to 1.
    """
    unit = 0.5 * z + 0.5
    kept = stored.astype(np.float64)
    if pipeline == "cudaraster":
        return np.abs(kept - (CUDARASTER[0] + CUDARASTER[1] * z))
    if pipeline == "freepipe":
        steps = 2.0**WORD_BITS if options.get("packing") == "32" else 1.0
        return np.abs(kept - unit * FREEPIPE) / steps
    if pipeline == "hardware":
        scale = float(DEPTHS[options.get("depth_format", "fixed32")].scale)
        if scale:
            return np.abs(kept - unit * scale)
        return _in_floats(stored.astype(np.uint32).view(np.float32), unit)
    if pipeline == "binned":
        return np.abs(kept - unit) * float(DEPTH_STEPS)
    if pipeline == "per-primitive":
        return np.abs(kept - unit) * PER_PRIMITIVE
    return _in_floats(stored.astype(np.float32), unit)


def _in_floats(kept: NDArray[np.float32], unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance in units of the last place of a float32."""
    distance: NDArray[np.float64] = np.abs(kept - unit) / np.spacing(unit.astype(np.float32)).astype(np.float64)
    return distance


def flip(truth: NDArray[np.float64], image: NDArray[np.uint8]) -> float:
    """Mean FLIP error (Andersson et al. 2020), 0 to 1, seen at 67 pixels a degree.

    Parameters
    ----------
    truth : ndarray, (H, W, 3), float64
        In [0, 1]: values that are shown, as those of the image are.
    image : ndarray, (H, W, 3), uint8
    """
    from flip_evaluator import evaluate

    test = np.ascontiguousarray(image, np.float32) / np.float32(255.0)
    mean: float = evaluate(np.ascontiguousarray(truth, np.float32), test, "LDR", applyMagma=False)[1]
    return float(mean)
