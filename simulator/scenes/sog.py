"""Splats from SOG: images of 8-bit channels and a meta.json of bounds and codebooks, in a folder or a zip (.sog)."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_file
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.splats import Splats, make_splats

META = "meta.json"
VERSION = 2
ROTATION_MARK = 252  # the fourth channel is this and the number of the part that is left out


def is_sog(path: Path) -> bool:
    """Whether a path is a SOG file, its meta.json, or a folder that has one."""
    return path.suffix.lower() == ".sog" or path.name == META or is_file(path / META)


def read_sog(path: Path, notes: Notes) -> Splats:
    """Read splats; raises TilestampError where a file is missing or broken."""
    if path.suffix.lower() == ".sog":
        try:
            with zipfile.ZipFile(path) as archive:
                return _splats(path, archive.read, notes)
        except zipfile.BadZipFile:
            raise TilestampError(f"{path}: is no .sog file (a zip)") from None
    folder = path.parent if path.name == META else path
    return _splats(path, lambda name: (folder / name).read_bytes(), notes)


def _splats(path: Path, read: Callable[[str], bytes], notes: Notes) -> Splats:
    try:
        meta = json.loads(read(META))
        if meta.get("version") != VERSION:
            raise TilestampError(f"{path}: is SOG of version {meta.get('version', 1)}; only version {VERSION} is read")
        notes.add_if("shN" in meta, "colours that depend on the direction (shN) are not read")
        return _decoded(meta, lambda name: _channels(read(name), int(meta["count"])))
    except (OSError, LookupError, ValueError, TypeError, AttributeError, OverflowError) as error:
        if isinstance(error, TilestampError):
            raise
        raise TilestampError(f"{path}: is no whole SOG scene ({error})") from None


def _channels(data: bytes, count: int) -> NDArray[np.uint8]:
    """Red, green, blue and alpha of the first pixels of an image, (count, 4)."""
    from PIL import Image

    with Image.open(io.BytesIO(data)) as image:
        pixels = np.asarray(image.convert("RGBA")).reshape(-1, 4)[:count]
    if count < 0:
        raise ValueError(f"a count of {count}")
    if len(pixels) < count:
        raise ValueError(f"an image has fewer than {count} pixels")
    return pixels


def _decoded(meta: dict[str, Any], image: Callable[[str], NDArray[np.uint8]]) -> Splats:
    from tilestamp.simulator.scenes.splat_ply import CONSTANT, from_smallest_three

    means = meta["means"]
    low, high = (image(name)[:, :3].astype(np.int64) for name in means["files"])
    first, last = np.array(means["mins"]), np.array(means["maxs"])
    logs = first + (low + 256 * high) / 65535.0 * (last - first)
    scales = np.exp(np.array(meta["scales"]["codebook"]))[image(meta["scales"]["files"][0])[:, :3]]
    packed = image(meta["quats"]["files"][0]).astype(np.float64)
    parts = (packed[:, :3] / 255 - 0.5) * np.sqrt(2)
    colours = image(meta["sh0"]["files"][0])
    return make_splats(
        np.sign(logs) * (np.exp(np.abs(logs)) - 1),
        scales,
        from_smallest_three(parts, (packed[:, 3] - ROTATION_MARK).astype(np.int64)),
        colours[:, 3] / 255.0,
        np.maximum(0.0, 0.5 + CONSTANT * np.array(meta["sh0"]["codebook"])[colours[:, :3]]),
    )
