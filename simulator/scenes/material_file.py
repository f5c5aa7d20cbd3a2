"""Reader of MTL material libraries: diffuse colours (``Kd``), opacity (``d``, ``Tr``) and textures (``map_Kd``).

A missing library or texture is not fatal, as in every viewer: the surface is white, or shows its Kd, as a note says.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_file
from tilestamp.simulator.scenes.images import read_image
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.text_scan import plain_text, read_bytes

# Options of map_Kd, each with the most numbers that may follow it; the least is one.
OPTIONS = {f"-{name}": 1 for name in ("blendu", "blendv", "bm", "boost", "cc", "clamp", "imfchan", "texres", "type")}
OPTIONS |= {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}


@dataclass
class Materials:
    """Surfaces by number.

    Parameters
    ----------
    base_colors : ndarray, (M, 4), float64
        Diffuse colour and opacity of each material.
    texture_of : ndarray, (M,), int32
        -1 for none.
    textures : tuple of ndarray, (H, W, 4), uint8
    textured : bool
        Whether a material has a texture, be it only named.
    """

    base_colors: NDArray[np.float64]
    texture_of: NDArray[np.int32]
    textures: tuple[NDArray[np.uint8], ...] = ()
    textured: bool = False
    files: dict[Path, int] = field(default_factory=dict)

    def cover(self, texture: NDArray[np.uint8]) -> None:
        """Give all materials one texture in place of their own."""
        self.texture_of[:], self.textures, self.textured = 0, (texture,), True


def read_materials(model: Path, libraries: list[str], names: dict[str, int], notes: Notes) -> Materials:
    """Read the materials that a model uses, ``names``, from the libraries that its ``mtllib`` lines name."""
    result = Materials(np.ones((len(names), 4)), np.full(len(names), -1, np.int32))
    files = [file for line in libraries for file in _libraries(model, line, notes)]
    lines = [(file, number, *line) for file in files for number, line in enumerate(_lines(file), start=1)]
    labels = {rest for _, _, word, rest in lines if word == "newmtl"}
    users: dict[str, list[int]] = {}
    for name, number in names.items():  # "red # skin" is red where no library has a material of the whole name
        users.setdefault(name if name in labels else _uncommented(name), []).append(number)
    current, skipped = list[int](), dict[str, None]()
    for file, number, word, rest in lines:
        if word == "newmtl":
            current = users.get(rest, users.get(_uncommented(rest), []))
        for row in current if word not in ("newmtl", "") else ():
            _read_line(result, row, word, rest, (file, number, model), skipped, notes)
    notes.add_if(skipped, f"statements of materials that are not read: {', '.join(skipped)}")
    missing = sorted(users.keys() - labels - {_uncommented(label) for label in labels} - {""})
    notes.add_if(missing, f"no library has the material {', '.join(missing[:8])}: its faces are white")
    result.base_colors = np.clip(result.base_colors, 0.0, 1.0)
    result.textures = tuple(read_image(read_bytes(file), file.name) for file in result.files)
    return result


def _lines(file: Path) -> list[tuple[str, str]]:
    """First word and rest of each line of a library; empty for nothing, a comment, or a line that goes on."""
    found, carried = [], ""
    for line in plain_text(read_bytes(file)).decode(errors="replace").split("\n"):
        word, _, rest = " ".join((carried + line.removesuffix("\\")).split()).partition(" ")
        carried = f"{word} {rest} " if line.endswith("\\") else ""
        found.append(("", "") if carried or word.startswith("#") else (word, rest))
    return found


def _uncommented(text: str) -> str:
    return text.partition(" #")[0]


def _libraries(model: Path, line: str, notes: Notes) -> list[Path]:
    """Files of one mtllib line: one whose name may hold spaces, or several."""
    whole = next((name for name in (line, _uncommented(line)) if _beside(name, model)), None)
    names = [whole] if whole else re.findall(r'".+?"|\S+', _uncommented(line))
    found = [_beside(name, model) for name in names]
    for name, file in zip(names, found, strict=True):
        notes.add_if(file is None, f"the material library {name} is not there: what it would colour is white")
    return [file for file in found if file is not None]


def _beside(name: str, *places: Path) -> Path | None:
    """Find a file beside one of the places, also where its name is quoted or has backslashes."""
    plain = name.strip().strip('"')
    for place in places:
        for form in (plain, plain.replace("\\", "/")):
            if is_file(place.parent / form):
                return place.parent / form
    return None


def _read_line(
    result: Materials,
    current: int,
    word: str,
    text: str,
    place: tuple[Path, int, Path],
    skipped: dict[str, None],
    notes: Notes,
) -> None:
    """Take one statement of a material."""
    file, number, model = place
    rest = _uncommented(text).split()
    if word == "Kd" and rest[:1] in (["spectral"], ["xyz"]):
        notes.add(f"Kd {rest[0]} is not read: the material keeps its white")
    elif word == "Kd":
        values = _numbers(rest[:3], f"{file}:{number}: Kd needs 3 numbers")
        result.base_colors[current, :3] = values if len(values) == 3 else values[0]
        if len(values) == 2:
            raise TilestampError(f"{file}:{number}: Kd needs 3 numbers, or one for all")
    elif word in ("d", "Tr"):
        notes.add_if("-halo" in rest, "d -halo is read as plain opacity")
        value = _numbers([text for text in rest if text != "-halo"][:1], f"{file}:{number}: {word} needs 1 number")[0]
        result.base_colors[current, 3] = value if word == "d" else 1.0 - value
    elif word == "map_Kd":
        result.textured = True
        name = _without_options(text.split(), notes)
        found = _beside(name, file, model) or _beside(_uncommented(name), file, model)
        notes.add_if(found is None, f"the texture {name} is not there: the colour Kd shows")
        if found is not None:
            result.texture_of[current] = result.files.setdefault(found, len(result.files))
    else:
        skipped[word[:20]] = None


def _without_options(words: list[str], notes: Notes) -> str:
    """File name of a map, without the options before it, which are noted."""
    while words and words[0] in OPTIONS:
        notes.add(f"the option {words[0]} of a texture is not applied")
        count = 1
        while 1 <= count < OPTIONS[words[0]] and len(words) > count + 2 and _is_number(words[count + 1]):
            count += 1
        words = words[count + 1 :]
    return " ".join(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _numbers(words: list[str], complaint: str) -> list[float]:
    values = [float(word) for word in words if _is_number(word)]
    if not values or len(values) != len(words) or not np.isfinite(values).all():
        raise TilestampError(complaint)
    return values
