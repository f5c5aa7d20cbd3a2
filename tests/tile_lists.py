"""Tile lists without bin and coarse raster: every tile that a sub-triangle's box touches, in input order."""

import numpy as np


def box_lists(setup, width, height):
    """Offsets, slots and all tiles, as fine raster takes them."""
    tiles_x, tiles_y = -(-width // 8), -(-height // 8)
    counts = setup.subtriangles.astype(np.int64)
    owners = np.repeat(np.arange(len(counts)), counts)
    first = np.where(setup.subtriangles > 1, setup.misc[: len(counts)], np.arange(len(counts)))
    slots = first[owners] + np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    points = setup.headers[slots].astype(np.int64).reshape(-1, 3, 2) + np.array([8 * width, 8 * height])
    low = np.clip(points.min(axis=1) >> 7, 0, [tiles_x - 1, tiles_y - 1])
    high = np.clip(points.max(axis=1) >> 7, 0, [tiles_x - 1, tiles_y - 1])
    size = high - low + 1
    area = size.prod(axis=1)
    which = np.repeat(np.arange(len(slots)), area)
    step = np.arange(len(which)) - np.repeat(np.cumsum(area) - area, area)
    tiles = low[which, 0] + step % size[which, 0] + (low[which, 1] + step // size[which, 0]) * tiles_x
    order = np.argsort(tiles, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(tiles, minlength=tiles_x * tiles_y))])
    return starts.astype(np.int64), slots[which[order]].astype(np.int32), np.arange(tiles_x * tiles_y, dtype=np.int32)
