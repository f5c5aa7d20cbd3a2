"""Gradients: the blending loop of the backward pass, as a counted variant of the published one.

A block walks its whole list from the end. A thread does nothing until it comes to the last entry that its pixel
blended; then it evaluates each entry again, and where it was blended adds nine gradients to those of the Gaussian
(three of the colour, two of the place, three of the conic, one of the opacity) by atomics: all lanes of a warp at the
same nine words. With ``reduced`` the warp adds up first, by shuffles, and one lane goes to memory (as DISTWAR and ARC
do). Only counted: nothing is differentiated here.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.blend_pixels import Pixels
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent, GradientEvent
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

Atomics = Literal["lanes", "reduced"]
WORDS = 9  # gradients of a Gaussian
RECORDS = ((12, 3), (12, 2), (16, 3), (4, 1))  # bytes of a record and words of it: colours, places, conics, opacities
ENTRY_SECTORS = 4  # of an entry: index, place, conic, colour
SHARED_BYTES = 40  # a thread: index 4, place 8, conic 16, colour 12
CHUNK_BYTES = 32
_E, _B = GradientEvent, BlendEvent


def gradients(
    blended: Work, pixels: Pixels, listed: NDArray[np.uint32], count: int, tiles: Tiles, simt: Simt, *, atomics: Atomics
) -> StageResult[None]:
    """Count the backward pass.

    Parameters
    ----------
    blended : Work
        Of the forward pass, a thread a pixel.
    pixels : Pixels
    listed : ndarray, (P,), uint32
    count : int
        Gaussians.
    tiles : Tiles
    simt : Simt
    atomics : {"lanes", "reduced"}

    Returns
    -------
    outputs : None
    works : one, a row a tile
    """
    forward, table = blended.table, np.zeros((tiles.total, len(_E)), np.int64)
    reached = by_warp(pixels.reached.astype(np.int64), tiles, simt.warp)
    shown = by_warp(np.ones(pixels.reached.shape, np.int64), tiles, simt.warp)
    table[:, _E.WARPS], table[:, _E.BLOCKS] = forward[:, _B.WARPS], 1
    table[:, _E.ENTRIES] = forward[:, _B.LIST]
    table[:, _E.BATCHES] = -(-forward[:, _B.LIST] // tiles.pixels)
    table[:, _E.STEPS] = forward[:, _B.LIST] * shown.any(axis=2).sum(axis=1)
    table[:, _E.WALK_STEPS] = reached.max(axis=2).sum(axis=1)
    table[:, _E.EVALUATIONS] = reached.sum(axis=(1, 2))
    table[:, _E.BLENDED], table[:, _E.BLEND_STEPS] = forward[:, _B.BLENDED], forward[:, _B.BLEND_STEPS]
    lanes = table[:, _E.BLENDED if atomics == "lanes" else _E.BLEND_STEPS]
    table[:, _E.REDUCED_STEPS] = table[:, _E.BLEND_STEPS] * (atomics == "reduced")
    table[:, _E.ATOMIC] = WORDS * table[:, _E.BLEND_STEPS]
    table[:, [_E.ATOMIC_LANES, _E.ATOMIC_REQUESTS, _E.ATOMIC_DEPTH]] = WORDS * lanes[:, None]
    table[:, _E.ATOMIC_CONFLICTS] = WORDS * (lanes - table[:, _E.BLEND_STEPS])
    table[:, _E.LOAD_TRANSACTIONS] = ENTRY_SECTORS * table[:, _E.ENTRIES]
    table[:, _E.LOAD_BYTES] = SECTOR_BYTES * table[:, _E.LOAD_TRANSACTIONS]
    uses = np.bincount(listed, pixels.uses[:, 0 if atomics == "lanes" else 1], count).astype(np.int64)
    return StageResult(None, (_work(table, requests(uses), tiles, len(listed), atomics),))


def by_warp(values: NDArray[np.int64], tiles: Tiles, warp: int) -> NDArray[np.int64]:
    """Numbers of the pixels by tile, warp and lane, (tiles, warps, lanes); 0 beyond the screen."""
    height, width = tiles.rows * tiles.tile_y, tiles.columns * tiles.tile_x
    whole = np.zeros((height, width), np.int64)
    whole[: values.shape[0], : values.shape[1]] = values
    parts = whole.reshape(tiles.rows, tiles.tile_y, tiles.columns, tiles.tile_x).swapaxes(1, 2)
    return parts.reshape(tiles.total, -1, min(warp, tiles.pixels))


def requests(uses: NDArray[np.int64]) -> NDArray[np.int64]:
    """Atomic requests by chunk of 32 bytes, of Gaussians whose nine words are each wanted so often."""
    found = []
    for size, words in RECORDS:
        places = np.arange(len(uses))[:, None] * size + 4 * np.arange(words)
        chunks = -(-len(uses) * size // CHUNK_BYTES)
        found.append(np.bincount(places.ravel() // CHUNK_BYTES, np.repeat(uses, words), chunks).astype(np.int64))
    return np.concatenate(found)


def _work(table: NDArray[np.int64], wanted: NDArray[np.int64], tiles: Tiles, pairs: int, atomics: Atomics) -> Work:
    moved, requested = SECTOR_BYTES * ENTRY_SECTORS * pairs, SECTOR_BYTES * int(wanted.sum())
    streams = (
        Stream("entries", "load", moved, moved),
        Stream("gradients", "atomic", requested, CHUNK_BYTES * len(wanted)),
    )
    block = tiles.pixels
    shared = SHARED_BYTES * tiles.pixels
    return Work(
        "gradients", _E, table, block, shared_bytes=shared, streams=streams, atomic_requests=wanted, variant=atomics
    )
