"""What the shading kernel reads and writes: fragments word by word, texels byte by byte (Ru 2016)."""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.texture import TextureChains
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from tilestamp.simulator.stages.thread_per_item import Access, record_transactions
from tilestamp.simulator.work import Work

SIDE = 8  # threads
BLOCK = SIDE * SIDE
LINE_BYTES = 128
TEXEL_BYTES = 3  # RGB8, a load for each byte
LOOK_WORDS = 1  # of a fragment: whether to shade it
LIGHT_WORDS = 5  # texture pointer (8 bytes), normal: whatever is shaded
TEXTURE_WORDS = 4  # coordinate, width, height
BILINEAR_TEXELS = 4
_DRAWN, _TEXTURED, _LINES, _ZEROS, _ZERO_LANES = range(5)  # of a warp: lanes, lanes, lines of 128 bytes, colours, lanes


class FragmentShadingEvent(IntEnum):
    """Events of one block of 8x8 pixels."""

    BLOCKS = 0
    WARPS = 1  # look at the fragment: is there one?
    WARP_LANES = 2
    DRAWN_WARPS = 3  # warps with a fragment: read the rest of it, shade
    DRAWN_LANES = 4
    DRAWN_BLOCKS = 5  # 1 where there is one: the dependent chain
    TEXTURED_WARPS = 6  # warps with a textured fragment: sample
    TEXTURED_LANES = 7
    TEXTURED_BLOCKS = 8
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12
    ZERO_TEXELS = 13  # colours of texels, by warp, of which a lane's is 0: its division by 255 takes the slow path
    ZERO_LANES = 14


def shading_work(
    drawn: NDArray[np.bool_],
    textures: NDArray[np.int32],
    uvs: NDArray[np.float32],
    chains: TextureChains,
    texture_filter: str,
    simt: Simt,
) -> Work:
    """Count the shading kernel.

    Parameters
    ----------
    drawn : ndarray, (H, W), bool
    textures : ndarray, (H, W), int32
        Texture of each fragment, -1 for none.
    uvs : ndarray, (H, W, 2), float32
    chains : TextureChains
    texture_filter : {"nearest", "bilinear"}
    simt : Simt
    """
    event = FragmentShadingEvent
    counts, footprint = _count_warps(drawn, textures, uvs, chains)
    table = np.zeros((len(counts) // 2, len(event)), np.int64)
    table[:, event.BLOCKS] = 1
    table[:, event.WARPS] = BLOCK // simt.warp
    table[:, event.WARP_LANES] = BLOCK
    drawn_columns = [event.DRAWN_WARPS, event.DRAWN_LANES, event.DRAWN_BLOCKS]
    textured_columns = [event.TEXTURED_WARPS, event.TEXTURED_LANES, event.TEXTURED_BLOCKS]
    for columns, counted in ((drawn_columns, _DRAWN), (textured_columns, _TEXTURED)):
        lanes = counts[:, counted].reshape(-1, 2)
        table[:, columns] = np.stack([(lanes > 0).sum(axis=1), lanes.sum(axis=1), lanes.any(axis=1)], axis=1)
    texels = BILINEAR_TEXELS if texture_filter == "bilinear" else 1
    both = texels * counts.reshape(-1, 2, counts.shape[1]).sum(axis=1)
    table[:, event.ZERO_TEXELS], table[:, event.ZERO_LANES] = both[:, _ZEROS], both[:, _ZERO_LANES]
    texel_lines = TEXEL_BYTES * both[:, _LINES]
    word = record_transactions(Access("fragments", FRAGMENT_BYTES, 1), simt)
    stored = record_transactions(Access("colors", 12, 3), simt)
    words = (
        table[:, event.WARPS] * LOOK_WORDS
        + table[:, event.DRAWN_WARPS] * LIGHT_WORDS
        + table[:, event.TEXTURED_WARPS] * TEXTURE_WORDS
    )
    table[:, event.LOAD_TRANSACTIONS] = words * word[0] + texel_lines
    table[:, event.LOAD_BYTES] = words * word[1] + texel_lines * LINE_BYTES
    table[:, event.STORE_TRANSACTIONS] = table[:, event.DRAWN_WARPS] * stored[0]
    table[:, event.STORE_BYTES] = table[:, event.DRAWN_WARPS] * stored[1]
    fragments, pixels = int(drawn.sum()), drawn.size
    texture_bytes = 32 * texels * int(table[:, event.TEXTURED_LANES].sum())
    streams = (
        Stream(
            "fragments",
            "load",
            32 * (pixels + fragments),
            min(32 * (pixels + fragments), FRAGMENT_BYTES * pixels),
            pair_bytes=FRAGMENT_BYTES * pixels,
        ),
        Stream("texture", "load", texture_bytes, min(texture_bytes, footprint * LINE_BYTES)),
        Stream("colors", "store", 12 * fragments, 12 * fragments),
    )
    kernel = f"fragment_shading_{texture_filter}"
    return Work("fragment_shading", event, table, BLOCK, kernel=kernel, streams=streams)


def by_warp(pixels: NDArray[Any]) -> NDArray[Any]:
    """Pixels as warps of 8x4, two a block of 8x8, (warps, 32); 0 beyond the picture."""
    rows, columns = -(-pixels.shape[0] // SIDE), -(-pixels.shape[1] // SIDE)
    padded = np.zeros((rows * SIDE, columns * SIDE), pixels.dtype)
    padded[: pixels.shape[0], : pixels.shape[1]] = pixels
    halves = padded.reshape(rows, 2, SIDE // 2, columns, SIDE).transpose(0, 3, 1, 2, 4)
    return halves.reshape(-1, SIDE * SIDE // 2)


def _texels(textures: NDArray[np.int32], uvs: NDArray[np.float32], chains: TextureChains) -> NDArray[np.int64]:
    """Nearest texel of each textured pixel."""
    level = chains.levels[textures, 0].astype(np.int64)
    texel = np.floor(np.mod(uvs, 1.0) * level[:, 1:]).astype(np.int64)
    found: NDArray[np.int64] = level[:, 0] + texel[:, 1] * level[:, 1] + texel[:, 0]
    return found


def _count_warps(
    drawn: NDArray[np.bool_], textures: NDArray[np.int32], uvs: NDArray[np.float32], chains: TextureChains
) -> tuple[NDArray[np.int64], int]:
    """Counts of each warp of 8x4 pixels, (warps, 5), and the 128-byte lines of texels that the frame touches."""
    mapped = textures >= 0
    texel = np.full(textures.shape, -1, np.int64)
    if mapped.any():
        texel[mapped] = _texels(textures[mapped], uvs[mapped], chains)
    rows, columns = -(-drawn.shape[0] // SIDE), -(-drawn.shape[1] // SIDE)
    counts = np.zeros((2 * rows * columns, _ZERO_LANES + 1), np.int64)
    touched = np.zeros(int(texel.max(initial=0)) * TEXEL_BYTES // LINE_BYTES + 1, np.bool_)
    for_parts(_count_rows, parts_of(rows), drawn, texel, chains.texels, counts, touched)
    return counts, int(touched.sum())


@kernel
def _count_rows(part: int, parts: int, drawn: Any, texel: Any, texels: Any, counts: Any, touched: Any) -> None:
    """Count the warps of a share of the rows of blocks; a block is two warps, the upper first."""
    lines = np.empty(BLOCK // 2, np.int64)
    zero = np.empty(TEXEL_BYTES, np.int64)
    across = -(-drawn.shape[1] // SIDE)
    rows = len(counts) // (2 * across)
    for warp in range(rows * part // parts * 2 * across, rows * (part + 1) // parts * 2 * across):
        block, row = warp // 2, counts[warp]
        top, left = block // across * SIDE + warp % 2 * (SIDE // 2), block % across * SIDE
        zero[:] = 0
        for y in range(top, min(top + SIDE // 2, drawn.shape[0])):
            for x in range(left, min(left + SIDE, drawn.shape[1])):
                row[_DRAWN] += drawn[y, x]
                t = texel[y, x]
                if t >= 0:
                    row[_TEXTURED] += 1
                    row[_LINES] += _is_new(t * TEXEL_BYTES // LINE_BYTES, lines, row[_LINES], touched)
                    for c in range(TEXEL_BYTES):
                        zero[c] += texels[t, c] == np.float32(0)
        for c in range(TEXEL_BYTES):
            row[_ZEROS] += zero[c] > 0
            row[_ZERO_LANES] += zero[c]


@kernel(lent=True)
def _is_new(line: int, lines: Any, known: int, touched: Any) -> bool:
    """Whether a line is none of the warp's first ``known``; it then is the next."""
    for i in range(known - 1, -1, -1):
        if lines[i] == line:
            return False
    lines[known] = line
    touched[line] = True
    return True
