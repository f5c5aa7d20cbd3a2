"""Slow, obvious blending: the fragments of each pixel in input order, and what programs of the ROP make of them."""

import numpy as np

from tests.tile_lists import box_lists
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.fine_raster import fine_raster
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

DEPTH_MAX = 2**32 - 1 - 17600


def prepared(positions, triangles, size):
    """Setup and lists of a draw without back-face culling."""
    setup = triangle_setup(
        np.asarray(positions, np.float32), np.asarray(triangles, np.int32), *size, Simt(), release="1.1", samples=1,
        cull_backfaces=False, depth=True, interpolate=True,
    ).outputs  # fmt: skip
    return setup, box_lists(setup, *size)


def fragments(positions, triangles, colors, size):
    """By pixel (y, x), row 0 the lowest: (colour, depth, triangle) of each fragment, in input order.

    Each triangle is drawn alone, so that no other can hide or change what it leaves.
    """
    found = {}
    for t, triangle in enumerate(triangles):
        setup, lists = prepared(positions, [triangle], size)
        alone = fine_raster(setup, *lists, *size, Simt(), release="1.1", mode="depth", colors=colors).outputs
        for y, x in np.argwhere(alone.ids[0] == 0):
            if y < size[1] and x < size[0]:
                entry = int(alone.color[0, y, x]), int(alone.depth[0, y, x]), t
                found.setdefault((int(y), int(x)), []).append(entry)
    return found


def channels(color):
    """Four bytes of a packed colour."""
    return [(color >> shift) & 255 for shift in (0, 8, 16, 24)]


def packed(values):
    """A colour of four bytes."""
    return sum(value << shift for value, shift in zip(values, (0, 8, 16, 24), strict=True))


def rounded(number, whole):
    """Nearest whole number to number / whole."""
    return (2 * number + whole) // (2 * whole)


def over(source, target):
    """Source over target in bytes."""
    a = channels(source)[3]
    pairs = zip(channels(source), channels(target), strict=True)
    return packed([rounded(s * a + d * (255 - a), 255) for s, d in pairs])


def additive(source, target):
    """Source times its alpha, added."""
    a = channels(source)[3]
    return packed([min(rounded(s * a, 255) + d, 255) for s, d in zip(channels(source), channels(target), strict=True)])


def largest(source, target):
    """Larger bytes."""
    return packed(map(max, channels(source), channels(target)))


def multiply(source, target):
    """Products of bytes."""
    return packed([rounded(s * d, 255) for s, d in zip(channels(source), channels(target), strict=True)])


def folded(program, entries, start=0):
    """Run a program of one word over fragments in order."""
    for color, _, _ in entries:
        start = program(color, start)
    return start


def k_buffer(entries, k):
    """Keep the k nearest; blend what falls out, and at the end the rest, farthest first."""
    color, kept = 0, []
    for entry in entries:
        kept = sorted([entry, *kept], key=lambda fragment: fragment[1])  # of equal depths the later in front
        if len(kept) > k:
            color = over(kept.pop()[0], color)
    return folded(over, reversed(kept), color)


def exact(entries):
    """Back to front in float64: red, green, blue and alpha of 0 to 1 over transparent black, by source over."""
    total = [0.0] * 4
    for color, _, _ in sorted(entries, key=lambda fragment: -fragment[1]):
        a = channels(color)[3] / 255
        total = [s / 255 * a + d * (1 - a) for s, d in zip(channels(color), total, strict=True)]
    return total
