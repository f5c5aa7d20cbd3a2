"""Reader of glTF 2.0 (.glb, .gltf): nodes and instances, materials, base-colour textures; broken files in a sentence.

Read are triangle lists with indices or without, positions, normals, the first texture coordinates, base-colour
factors and textures, matrices and translation-rotation-scale of nodes, any number of instances. Animations, skins,
cameras and lights are passed over. Draco, meshopt and sparse accessors are refused by name.
"""

import base64
import binascii
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError

MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
TRIANGLES = 4
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class GltfFile:
    """A parsed file: the JSON tree and its buffers.

    Parameters
    ----------
    path : Path
        A .glb or .gltf file.

    Raises
    ------
    TilestampError
        Not glTF 2.0, broken, or in need of an extension that is not read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.tree, self._binary = _split(path)
        except OSError as error:
            raise TilestampError(f"{path.name}: cannot be read: {error.strerror}") from None
        except (ValueError, struct.error) as error:
            raise TilestampError(f"{path.name}: broken glTF: {error}") from None
        if not str(self.tree.get("asset", {}).get("version", "")).startswith("2"):
            raise TilestampError(f"{path.name}: only glTF 2.0 is read, this says version {self.tree.get('asset')}")
        for extension in self.tree.get("extensionsRequired", []):
            if extension != "KHR_materials_unlit":
                raise TilestampError(f"{path.name}: needs the glTF extension {extension}, which is not read")
        self._buffers: dict[int, bytes] = {}

    def accessor(self, index: int) -> NDArray[Any]:
        """Values of one accessor, (count, width); normalized integers as floats."""
        accessor = self._entry("accessors", index)
        if "sparse" in accessor:
            raise TilestampError(f"{self.path.name}: accessor {index} is sparse, which is not read")
        try:
            kind, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
            count = int(accessor["count"])
            if "bufferView" not in accessor:
                return np.zeros((count, width), kind)
            view = self._entry("bufferViews", accessor["bufferView"])
            data = self._buffer(view["buffer"])
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            strides = (view.get("byteStride") or kind.itemsize * width, kind.itemsize)
            values = np.ndarray((count, width), kind, data, start, strides).copy()
        except (KeyError, TypeError, ValueError) as error:
            raise TilestampError(f"{self.path.name}: broken glTF: accessor {index}: {error}") from None
        if accessor.get("normalized"):
            floats: NDArray[Any] = np.maximum(
                values.astype(np.float32) / np.float32(np.iinfo(kind).max), np.float32(-1.0)
            )
            return floats
        return values

    def image(self, index: int) -> NDArray[np.uint8]:
        """One image as RGBA, (H, W, 4)."""
        entry = self._entry("images", index)
        if "bufferView" in entry:
            view = self._entry("bufferViews", entry["bufferView"])
            start = view.get("byteOffset", 0)
            data = self._buffer(view["buffer"])[start : start + view["byteLength"]]
        else:
            data = self._uri(str(entry.get("uri", "")))
        return read_image(data, f"{self.path.name}: image {index}")

    def instances(self) -> list[tuple[int, NDArray[np.float64]]]:
        """Every drawn mesh with its node's matrix to the scene, in the order of the node tree."""
        scenes = self.tree.get("scenes") or [{"nodes": list(range(len(self.tree.get("nodes", []))))}]
        found: list[tuple[int, NDArray[np.float64]]] = []
        index = self.tree.get("scene", 0)
        if not 0 <= index < len(scenes):
            raise TilestampError(f"{self.path.name}: broken glTF: there is no scene {index}")
        for node in scenes[index].get("nodes", []):
            self._walk(node, np.eye(4), found, depth=0)
        return found

    def _walk(self, index: int, parent: NDArray[np.float64], found: list[Any], depth: int) -> None:
        if depth > len(self.tree.get("nodes", [])):
            raise TilestampError(f"{self.path.name}: broken glTF: node {index} is its own ancestor")
        node = self._entry("nodes", index)
        matrix = parent @ _local(node)
        if "mesh" in node:
            found.append((node["mesh"], matrix))
        for child in node.get("children", []):
            self._walk(child, matrix, found, depth + 1)

    def _entry(self, table: str, index: Any) -> dict[str, Any]:
        rows = self.tree.get(table, [])
        if not isinstance(index, int) or not 0 <= index < len(rows):
            raise TilestampError(f"{self.path.name}: broken glTF: there is no {table} {index}")
        row: dict[str, Any] = rows[index]
        return row

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self._entry("buffers", index).get("uri")
            self._buffers[index] = self._uri(uri) if uri else self._binary
        return self._buffers[index]

    def _uri(self, uri: str) -> bytes:
        """Bytes behind a data URI or a file beside this one."""
        try:
            if uri.startswith("data:"):
                return base64.b64decode(uri.split(",", 1)[1], validate=True)
            return (self.path.parent / uri).read_bytes()
        except (OSError, IndexError, binascii.Error):
            raise TilestampError(f"{self.path.name}: cannot read {uri[:60] or 'an image without data'}") from None


def read_image(data: bytes, what: str) -> NDArray[np.uint8]:
    """Decode an image file to RGBA, (H, W, 4) uint8."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)) as image:
            return np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except (UnidentifiedImageError, OSError):
        raise TilestampError(f"{what} is not an image that can be read") from None


def _split(path: Path) -> tuple[dict[str, Any], bytes]:
    """Take a file apart into its JSON tree and the binary chunk of a .glb."""
    data = path.read_bytes()
    if len(data) < 12 or struct.unpack_from("<I", data)[0] != MAGIC:
        tree: dict[str, Any] = json.loads(data)
        if not isinstance(tree, dict):
            raise ValueError("its JSON is not an object")
        return tree, b""
    chunks: dict[int, bytes] = {}
    offset = 12
    while offset + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + size > len(data):
            raise ValueError("it ends in the middle of a chunk")
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if JSON_CHUNK not in chunks:
        raise ValueError("it has no JSON chunk")
    return json.loads(chunks[JSON_CHUNK]), chunks.get(BINARY_CHUNK, b"")


def _local(node: dict[str, Any]) -> NDArray[np.float64]:
    """Give a node's own matrix, row-major for column vectors."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.asarray(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
