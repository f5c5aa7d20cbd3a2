"""Splats from PLY files: the published form (log scales, logit opacities, harmonics), and the compressed one.

The compressed form keeps chunks of 256 Gaussians with their bounds, and of each Gaussian four words: position in 11, 10
and 11 bits, rotation in 2 bits that name the largest part and 10 for each other, log scale in 11, 10 and 11, colour and
opacity in 8 each.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.ply_file import Element, read_elements
from tilestamp.simulator.scenes.splats import HARMONICS, Splats, make_splats

CONSTANT = 0.28209479177387814  # the spherical harmonic of degree 0
HEADER_BYTES = 1 << 14  # in which the properties of a header stand
MARK = re.compile(rb"[\r\n]\s*property\s+\w+\s+(f_dc_0|packed_position)\b")  # by which a PLY file has splats
CHUNK = 256
Floats = NDArray[np.float64]


def has_splats(path: Path) -> bool:
    """Whether a PLY file has splats and no mesh."""
    try:
        with path.open("rb") as file:
            start = file.read(HEADER_BYTES)
    except OSError:
        return False
    return MARK.search(start.partition(b"end_header")[0]) is not None


def read_splat_ply(path: Path, notes: Notes) -> Splats:
    """Read splats of either form; raises TilestampError."""
    elements = read_elements(path, notes)
    notes.add_if("sh" in elements, "colours that depend on the direction are not read from a compressed file")
    try:
        vertex = elements["vertex"]
        if "packed_position" in vertex.values:
            return _compressed(vertex, elements["chunk"])
        return _published(vertex)
    except KeyError as error:
        raise TilestampError(f"{path}: a splat file without {error.args[0]}") from None


def unit(rotations: Floats) -> Floats:
    """Quaternions of length 1, as the published program hands them to its rasterizer; of none where it is 0."""
    with np.errstate(all="ignore"):
        units: Floats = np.nan_to_num(rotations / np.linalg.norm(rotations, axis=1, keepdims=True))
    return units


def from_smallest_three(parts: Floats, largest: NDArray[np.integer]) -> Floats:
    """Quaternions (N, 4) from the three other parts, (N, 3), and which one is left out because it is the largest."""
    rest = np.sqrt(np.maximum(0.0, 1.0 - (parts**2).sum(axis=1)))
    rotations = np.zeros((len(parts), 4))
    for k in range(4):
        chosen = largest == k
        rotations[np.ix_(chosen, [i for i in range(4) if i != k])] = parts[chosen]
        rotations[chosen, k] = rest[chosen]
    return rotations


def _columns(element: Element, *names: str) -> Floats:
    return np.stack([element.values[name].astype(np.float64) for name in names], axis=1)


def _published(vertex: Element) -> Splats:
    """Scales are logarithms, opacities logits, colours coefficients of harmonics, first all of red."""
    count = sum(name.startswith("f_rest_") for name in vertex.values)
    if count % 3 or count // 3 not in HARMONICS:
        raise TilestampError(f"a splat file has 0, 9, 24 or 45 properties f_rest_*, not {count}")
    colours = 0.5 + CONSTANT * _columns(vertex, "f_dc_0", "f_dc_1", "f_dc_2")
    harmonics = None
    if count:
        rest = np.stack([vertex.values[f"f_rest_{k}"] for k in range(count)], axis=1)
        harmonics = rest.reshape(len(rest), 3, count // 3).transpose(0, 2, 1)
    return make_splats(
        _columns(vertex, "x", "y", "z"),
        np.exp(_columns(vertex, "scale_0", "scale_1", "scale_2")),
        unit(_columns(vertex, "rot_0", "rot_1", "rot_2", "rot_3")),
        1.0 / (1.0 + np.exp(-_columns(vertex, "opacity"))),
        np.maximum(0.0, colours) if harmonics is None else colours,
        harmonics,
    )


def _unpacked(words: NDArray[np.uint32]) -> Floats:
    """Three numbers in [0, 1] from 11, 10 and 11 bits."""
    parts = (words >> 21) & 2047, (words >> 11) & 1023, words & 2047
    shares: Floats = np.stack(parts, axis=1) / np.array([2047.0, 1023.0, 2047.0])
    return shares


def _compressed(vertex: Element, chunk: Element) -> Splats:
    names = ("position", "rotation", "scale", "color")
    words = {name: vertex.values[f"packed_{name}"].astype(np.uint32) for name in names}
    of = np.arange(len(words["position"])) // CHUNK
    if len(of) and of[-1] >= chunk.rows:
        raise TilestampError(f"a splat file with {chunk.rows} chunks has fewer than its {len(of)} Gaussians need")

    def between(shares: Floats, *axes: str) -> Floats:
        low, high = (_columns(chunk, *(f"{end}_{axis}" for axis in axes))[of] for end in ("min", "max"))
        return low + shares * (high - low)

    packed = words["rotation"]
    parts = np.stack([(packed >> shift) & 1023 for shift in (20, 10, 0)], axis=1) / 1023.0
    bytes_ = np.stack([(words["color"] >> shift) & 255 for shift in (24, 16, 8, 0)], axis=1) / 255.0
    colours = bytes_[:, :3]
    if "min_r" in chunk.values:
        colours = between(colours, "r", "g", "b")
    return make_splats(
        between(_unpacked(words["position"]), "x", "y", "z"),
        np.exp(between(_unpacked(words["scale"]), "scale_x", "scale_y", "scale_z")),
        from_smallest_three((parts - 0.5) * np.sqrt(2), packed >> 30),
        bytes_[:, 3],
        np.maximum(0.0, colours),
    )
