"""Programs of the ROP: what a pixel keeps in shared memory, and what a fragment does to it (Laine & Karras 2011, 8).

A fragment is a packed colour, a fixed-point depth, and a key that no other fragment has. Programs run in input order
within a pixel, and see nothing but the pixel's words; the tile is written when all of its fragments are done.

over        source over target, by the source's alpha, in bytes: what the mode ``blend`` does
additive    the source times its alpha, added; saturates
max         the larger byte of each channel
multiply    bytes multiplied
nearest     the depth test, as a program: the first of the nearest fragments shows
k-buffer    the k nearest fragments, sorted; what falls out at the far end is blended over the colour at once (Bavoil
            et al. 2007). Exact where fragments come back to front but for k places.
stochastic  S samples with a depth each; a fragment covers each with the probability of its alpha (Enderton et al.
            2010). Of a single layer the mean's variance is a (1 - a) / S.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from inspect import isfunction
from typing import Any

import numba
import numpy as np
from numba import config
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.fine_raster_shade import blend_over
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX

BUILT_IN = ("over", "additive", "max", "multiply", "nearest", "k-buffer", "stochastic")
OVER, ADDITIVE, MAX, MULTIPLY, NEAREST, K_BUFFER, STOCHASTIC = range(len(BUILT_IN))
FARTHEST = 2**32 - 1
_LOW = 0xFFFFFFFF
Words = NDArray[np.int64]


@dataclass(frozen=True)
class BlendProgram:
    """A program of the ROP.

    Parameters
    ----------
    apply : callable
        ``apply(pixel, color, depth, key)`` changes ``pixel``, an int64 array of its 32-bit words, in place. Numba
        compiles it; its word 0 is the colour, RGBA from the low byte up.
    words : int
        32-bit words a pixel; the first starts as the clear colour, the others as 0.
    operations : dict of str to float
        Warp instructions of one execution by class (``int32``, ``mul32``, ``fp32``, ``sfu``, ``control``, ``shared``),
        beyond those of blending over: what cannot be read off a function on a CPU.
    """

    apply: Callable[[Any, int, int, int], None]
    words: int = 1
    operations: dict[str, float] = field(default_factory=dict)


def words_of(program: int, layers: int) -> int:
    """32-bit words that a pixel has for a program of the library."""
    return {NEAREST: 2, K_BUFFER: 1 + 2 * layers, STOCHASTIC: 2 * layers}.get(program, 1)


@kernel(lent=True)
def start_pixel(pixel: Any, program: int, clear_color: int) -> None:
    """Words of a pixel that no fragment has come to: (colour, depth) pairs, behind one colour for the k-buffer."""
    pixel[:] = 0
    pixel[0] = clear_color
    if program in (NEAREST, STOCHASTIC):
        for i in range(0, pixel.size, 2):
            pixel[i], pixel[i + 1] = clear_color, DEPTH_MAX
    if program == K_BUFFER:
        for i in range(2, pixel.size, 2):
            pixel[i] = FARTHEST


@kernel(lent=True)
def blend(pixel: Any, program: int, color: int, depth: int, key: int) -> None:
    """Run a program of the library for one fragment."""
    if program == OVER:
        pixel[0] = blend_over(color, pixel[0])
    elif program < NEAREST:
        pixel[0] = _by_channel(color, pixel[0], program)
    elif program == NEAREST:
        if depth < pixel[1]:
            pixel[0], pixel[1] = color, depth
    elif program == K_BUFFER:
        for i in range(1, pixel.size, 2):
            if depth <= pixel[i + 1]:  # of equal depths the later lies in front
                pixel[i], color = color, pixel[i]
                pixel[i + 1], depth = depth, pixel[i + 1]
        if depth < FARTHEST:
            pixel[0] = blend_over(color, pixel[0])
    else:
        for i in range(0, pixel.size, 2):
            key = random_word(key + i)
            if (key & 0xFFFFFF) * 255 < (color >> 24) << 24 and depth < pixel[i + 1]:
                pixel[i], pixel[i + 1] = color, depth


@kernel(lent=True)
def resolved(pixel: Any, program: int) -> Any:
    """Colour that a pixel's words stand for, packed."""
    result = pixel[0]
    if program == K_BUFFER:
        for i in range(pixel.size - 2, 0, -2):
            result = blend_over(pixel[i], result) if pixel[i + 1] < FARTHEST else result
    if program == STOCHASTIC:
        samples = pixel.size // 2
        result = 0
        for shift in range(0, 32, 8):
            total = 0
            for i in range(0, pixel.size, 2):
                total += (pixel[i] >> shift) & 255
            result |= (2 * total + samples) // (2 * samples) << shift
    return result


@kernel(lent=True)
def _by_channel(source: Any, target: Any, program: int) -> Any:
    """Additive, largest or multiplied bytes; alpha too."""
    alpha, result = (source >> 24) & 255, source & 0
    for shift in range(0, 32, 8):
        s, d = (source >> shift) & 255, (target >> shift) & 255
        if program == ADDITIVE:
            value = min(_product(s, alpha) + d, 255)
        elif program == MAX:
            value = max(s, d)
        else:
            value = _product(s, d)
        result |= value << shift
    return result


@kernel(lent=True)
def _product(a: Any, b: Any) -> Any:
    """Product of two bytes that stand for 0 to 1, rounded to nearest."""
    return (a * b * 0x010101 + 0x800000) >> 24


@kernel(lent=True)
def random_word(key: int) -> Any:
    """32 bits that look random: multiplications by odd numbers between shifts."""
    word = key & _LOW
    word = ((word ^ (word >> 16)) * 0x2C1B3C6D) & _LOW
    word = ((word ^ (word >> 15)) * 0x297A2D39) & _LOW
    return word ^ (word >> 15)


@cache
def find_program(name: str) -> BlendProgram:
    """Find a program of the user's by ``module:name``; a plain function keeps one word.

    Raises
    ------
    TilestampError
        Where there is none.
    """
    module, _, attribute = name.partition(":")
    try:
        found: Any = getattr(import_module(module), attribute) if attribute else None
    except (ImportError, AttributeError, ValueError) as error:
        raise TilestampError(f"blend takes text that names a function, not {name!r}: {error}") from None
    if not (isinstance(found, BlendProgram) or isfunction(getattr(found, "py_func", found))):
        raise TilestampError(f"blend takes text: {', '.join(BUILT_IN)}, or MODULE:NAME of a function, not {name!r}")
    return found if isinstance(found, BlendProgram) else BlendProgram(found)


@cache
def compiled(apply: Callable[..., None]) -> Callable[..., None]:
    """Compile the user's function for a whole tile: ``run(pixels, where, colors, depths, keys)``, in order."""
    if config.DISABLE_JIT:
        return _runner(apply)
    function = numba.njit(getattr(apply, "py_func", apply), boundscheck=True)  # of the pixel's words
    made: Callable[..., None] = numba.njit(nogil=True)(_runner(function))
    return made


def _runner(apply: Callable[..., None]) -> Callable[..., None]:
    def run(pixels: Words, where: Words, colors: Words, depths: Words, keys: Words) -> None:
        for i in range(where.size):
            apply(pixels[where[i]], colors[i], depths[i], keys[i])

    return run
