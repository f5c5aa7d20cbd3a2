"""Fine raster, colour: barycentrics from integer planes, vertex colours, and blending (cudaraster 1.1)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.coverage import SAMPLE_COLUMN
from tilestamp.simulator.stages.laine2011.exact import wrap_int32
from tilestamp.simulator.stages.laine2011.fine_raster_queue import Draw
from tilestamp.simulator.stages.laine2011.lanes import mixed

_W, _U, _V = np.int64(4), np.int64(7), np.int64(10)  # where the planes of 1/w, u/w and v/w begin in a record


@kernel(error_model="numpy", lent=True)
def _plane(planes: Any, record: Any, at: Any, x: Any, y: Any) -> Any:
    value = np.int64(planes[record, at]) * x + np.int64(planes[record, at + 1]) * y + np.int64(planes[record, at + 2])
    return np.float32(wrap_int32(value))


@kernel(error_model="numpy", lent=True)
def shade(planes: Any, record: int, colors: Any, x: int, y: int, sample: int, draw: Draw) -> Any:
    """Interpolated vertex colour of one fragment, as 8-bit RGBA.

    Parameters
    ----------
    planes : array (S, 16), uint32
    record : int
        The fragment's.
    colors : array (V, 4), float32
    x, y : int
        Pixel.
    sample : int
        Where in the pixel: a sample, or -1 for the centre.
    draw : Draw
    """
    u, v = np.float32(0), np.float32(1)  # without interpolation: the last vertex
    if draw.interpolate:
        s = draw.log_samples
        at_x, at_y = (2 * x + 1) << s, (2 * y + 1) << s
        if sample >= 0:
            at_x = 2 * ((x << s) + SAMPLE_COLUMN[s, sample]) + 1
            at_y = 2 * ((y << s) + sample) + 1
        w = np.float32(1) / _plane(planes, record, _W, at_x, at_y)
        u = w * _plane(planes, record, _U, at_x, at_y)
        v = w * _plane(planes, record, _V, at_x, at_y)
    t = np.float32(1) - u - v
    corners = np.int64(planes[record, 13]), np.int64(planes[record, 14]), np.int64(planes[record, 15])
    return mixed(colors, corners, (t, u, v))


@kernel(lent=True)
def blend_over(source: Any, target: int) -> Any:
    """Source over target, channel by channel, alpha too."""
    alpha = (source >> 24) & 255
    result = np.int64(0)
    for c in range(4):
        s, d = (source >> (8 * c)) & 255, (target >> (8 * c)) & 255
        result |= ((((s * alpha + d * (255 - alpha)) * 0x010101 + 0x800000) >> 24) & 255) << (8 * c)
    return result
