"""The merge buffer: quads of 2x2 pixels that wait for those of neighbouring polygons (Fatahalian et al. 2010).

A quad joins a waiting one at the same place that faces the same way, shares no covered sample with it, and has a
polygon that shares an edge with this one's. Waiting quads are asked from the newest on, and none is passed that covers
a sample of the new one, so that every sample is written in input order. A quad that joins none takes an entry of its
own; in a full buffer the oldest leaves to be shaded. The abstract of the paper says that fragments of adjacent
triangles are gathered and merged; facing, coverage, and that the polygon over a pixel's centre is the one that is
shaded are the rules of a patent on it (US 9,626,795, abstract). Order and eviction are our reading.
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel

PIXELS = 4  # of a quad
MEMBERS = 64  # polygons that one entry can name; one more finds it full


class MergeBuffer(NamedTuple):
    """Entries of one buffer, a ring: entry i is element i modulo the size.

    Parameters
    ----------
    place, facing, members : ndarray, (n,), int64
        Number of the quad on screen, the sign of its polygons' area, and how many they are.
    mask : ndarray, (n,), uint64
        Covered samples, those of pixel k from bit k * spp on.
    polygons : ndarray, (n, 64), int64
    seen : ndarray, (n, 4), int64
        Polygon that is shaded at each pixel, -1 for a helper.
    span : ndarray, (2,), int64
        Oldest entry, and the one after the newest.
    """

    place: np.ndarray
    facing: np.ndarray
    members: np.ndarray
    mask: np.ndarray
    polygons: np.ndarray
    seen: np.ndarray
    span: np.ndarray


@kernel
def new_buffer(entries: int) -> Any:
    """Empty buffer."""
    i64 = np.int64
    return MergeBuffer(
        np.zeros(entries, i64), np.zeros(entries, i64), np.zeros(entries, i64), np.zeros(entries, np.uint64),
        np.zeros((entries, MEMBERS), i64), np.zeros((entries, PIXELS), i64), np.zeros(2, i64),
    )  # fmt: skip


@kernel
def _adjacent(buffer: MergeBuffer, e: int, polygon: int, corners: Any, shared: int) -> bool:
    """Whether a polygon shares so many vertices with one of an entry."""
    for m in range(buffer.members[e]):
        same = 0
        for k in range(corners.shape[1]):
            for n in range(corners.shape[1]):
                same += corners[polygon, k] == corners[buffer.polygons[e, m], n]
        if same >= shared:
            return True
    return False


@kernel
def find(
    buffer: MergeBuffer, before: int, place: int, facing: int, mask: Any, polygon: int, corners: Any, shared: int
) -> int:
    """Newest entry before one, counted from the start, that a quad can join, -1 for none."""
    size = len(buffer.place)
    for i in range(before - 1, buffer.span[0] - 1, -1):
        e = i % size
        if buffer.place[e] != place:
            continue
        if buffer.mask[e] & mask != np.uint64(0):
            return -1
        if (
            buffer.facing[e] == facing
            and buffer.members[e] < MEMBERS
            and _adjacent(buffer, e, polygon, corners, shared)
        ):
            return i
    return -1


@kernel
def join(buffer: MergeBuffer, i: int, polygon: int, mask: Any, covers: Any, spp: int) -> None:
    """Add a polygon's quad to an entry; ``covers``: where it lies over the pixel's centre."""
    e = i % len(buffer.place)
    pixel = (np.uint64(1) << np.uint64(spp)) - np.uint64(1)
    buffer.mask[e] |= mask
    buffer.polygons[e, buffer.members[e]] = polygon
    buffer.members[e] += 1
    for k in range(PIXELS):
        here = (mask >> np.uint64(k * spp)) & pixel
        if here != np.uint64(0) and (covers[k] or buffer.seen[e, k] < 0):
            buffer.seen[e, k] = polygon


@kernel
def start(buffer: MergeBuffer, place: int, facing: int) -> Any:
    """Take the next entry, which must be free, for a quad; returns it, counted from the start."""
    i = buffer.span[1]
    e = i % len(buffer.place)
    buffer.place[e], buffer.facing[e], buffer.members[e], buffer.mask[e] = place, facing, 0, 0
    buffer.seen[e] = -1
    buffer.span[1] += 1
    return i
