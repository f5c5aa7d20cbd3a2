"""Fine raster, colour: barycentrics from integer planes, vertex colours, and blending (cudaraster 1.1)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.coverage import SAMPLE_COLUMN
from tilestamp.simulator.stages.laine2011.exact import wrap_int32
from tilestamp.simulator.stages.laine2011.fine_raster_queue import Draw

_PLANES = np.array([4, 7, 10])  # where the planes of 1/w, u/w and v/w begin in a record


@kernel(error_model="numpy")
def _plane(record: Any, at: Any, x: Any, y: Any) -> Any:
    value = np.int64(record[at]) * x + np.int64(record[at + 1]) * y + np.int64(record[at + 2])
    return np.float32(wrap_int32(value))


@kernel
def _channel(value: Any) -> Any:
    """Eight bits of a channel in 0..1, rounded to nearest, saturating."""
    return np.int64(min(max(np.floor(np.float64(value) * 255.0 + 0.5), 0.0), 255.0)) if value == value else 0  # noqa: PLR0124


@kernel(error_model="numpy")
def shade(record: Any, colors: Any, x: int, y: int, sample: int, draw: Draw) -> Any:
    """Interpolated vertex colour of one fragment, as 8-bit RGBA.

    Parameters
    ----------
    record : array (16,), uint32
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
        w = np.float32(1) / _plane(record, _PLANES[0], at_x, at_y)
        u = w * _plane(record, _PLANES[1], at_x, at_y)
        v = w * _plane(record, _PLANES[2], at_x, at_y)
    t = np.float32(1) - u - v
    packed = np.int64(0)
    for c in range(4):
        value = t * colors[record[13], c] + u * colors[record[14], c] + v * colors[record[15], c]
        packed |= _channel(value) << (8 * c)
    return packed


@kernel
def blend_over(source: Any, target: int) -> Any:
    """Source over target, channel by channel, alpha too."""
    alpha = (source >> 24) & 255
    result = np.int64(0)
    for c in range(4):
        s, d = (source >> (8 * c)) & 255, (target >> (8 * c)) & 255
        result |= ((((s * alpha + d * (255 - alpha)) * 0x010101 + 0x800000) >> 24) & 255) << (8 * c)
    return result
