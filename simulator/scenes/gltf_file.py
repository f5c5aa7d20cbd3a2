"""A glTF 2.0 file (.glb, .gltf) taken apart: its tree, accessors, images, placed nodes; broken ones in a sentence.

Our own, because pygltflib gives the tree only, and trimesh drops coordinate sets, samplers and draws.
Compressed buffers (Draco, meshopt) are refused by name.
"""

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_file
from tilestamp.simulator.scenes.images import read_image
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.text_scan import plain_text, read_bytes

MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
# Extensions that a file may need: what they change is read, or changes no triangle (then a note names them).
READ = ("KHR_materials_unlit", "KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp")
LOOKS = ("KHR_materials_", "KHR_lights_")
MOST_ZEROS = 2**22  # values of an accessor without data
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

    def __init__(self, path: Path, notes: Notes) -> None:
        self.path, self.notes = path, notes
        try:
            self.tree, self._binary = _split(path)
        except (ValueError, RecursionError, struct.error) as error:
            raise TilestampError(f"{path.name}: broken glTF: {error}") from None
        if not str(self.tree.get("asset", {}).get("version", "")).startswith("2"):
            raise TilestampError(f"{path.name}: only glTF 2.0 is read, this says version {self.tree.get('asset')}")
        for extension in self.tree.get("extensionsRequired", []):
            if extension not in READ and not extension.startswith(LOOKS):
                raise TilestampError(f"{path.name}: needs the glTF extension {extension}, which is not read")
        self._buffers: dict[int, bytes] = {}

    def accessor(self, index: int, *kinds: str) -> NDArray[Any]:
        """Values of one accessor of one of some kinds ("VEC3"), (count, width); normalized integers as floats."""
        accessor = self._entry("accessors", index)
        if accessor.get("type") not in kinds:
            what = f"accessor {index} is {accessor.get('type')} where {' or '.join(kinds)} should be"
            raise TilestampError(f"{self.path.name}: broken glTF: {what}")
        try:
            kind, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
            count = int(accessor["count"])
            if "bufferView" in accessor:
                values = self._values(accessor, kind, count, width)
            else:
                values = np.zeros((count if count * width <= MOST_ZEROS else -1, width), kind)
            if "sparse" in accessor:
                self._substitute(values, accessor["sparse"], kind)
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise TilestampError(f"{self.path.name}: broken glTF: accessor {index}: {error}") from None
        if not accessor.get("normalized") or kind.kind == "f":
            return values
        largest = np.float32(np.iinfo(kind).max)
        floats: NDArray[Any] = np.maximum(values.astype(np.float32) / largest, np.float32(-1.0))
        return floats

    def _values(self, place: dict[str, Any], kind: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Give (count, width) values of a buffer view."""
        view = self._entry("bufferViews", place["bufferView"])
        start, offset = view.get("byteOffset", 0), place.get("byteOffset", 0)
        whole = memoryview(self._buffer(view["buffer"]))  # of which a part is no copy
        data = whole[: start + view.get("byteLength", len(whole))]
        strides = (view.get("byteStride") or kind.itemsize * width, kind.itemsize)
        return np.ndarray((count, width), kind, data, start + offset, strides).copy()

    def _substitute(self, values: NDArray[Any], sparse: dict[str, Any], kind: np.dtype[Any]) -> None:
        """Put in the values in which a sparse accessor differs from its buffer view (or from zero)."""
        count, places = sparse["count"], sparse["indices"]
        rows = self._values(places, np.dtype(_COMPONENTS[places["componentType"]]), count, 1)[:, 0]
        if len(rows) and rows.max() >= len(values):
            raise ValueError(f"its sparse index {rows.max()} is beyond its {len(values)} values")
        values[rows] = self._values(sparse["values"], kind, count, values.shape[1])

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
        found: list[tuple[int, NDArray[np.float64]]] = []
        waiting = [(index, np.eye(4)) for index in reversed(self._roots())]
        visits: dict[int, int] = {}
        while waiting:
            index, parent = waiting.pop()
            node = self._entry("nodes", index)
            visits[index] = visits.get(index, 0) + 1
            if visits[index] > 1:
                raise TilestampError(
                    f"{self.path.name}: broken glTF: node {index} is its own ancestor or has two parents"
                )
            matrix = parent @ _local(node)
            if "mesh" in node:
                found.append((node["mesh"], matrix))
            self.notes.add_if("skin" in node, "skins are not applied: meshes stand as they were modelled")
            waiting += [(child, matrix) for child in reversed(node.get("children", []))]
        return found

    def _roots(self) -> list[int]:
        """Give the first nodes of the scene to draw: of a file without scenes, all that are no other's children."""
        nodes, scenes, index = self.tree.get("nodes", []), self.tree.get("scenes") or [], self.tree.get("scene", 0)
        if not scenes and "scene" not in self.tree:
            self.notes.add_if(nodes, "the file names no scene: all nodes are drawn")
            children = {child for node in nodes for child in node.get("children", [])}
            return [node for node in range(len(nodes)) if node not in children]
        if not isinstance(index, int) or not 0 <= index < len(scenes):
            raise TilestampError(f"{self.path.name}: broken glTF: there is no scene {index}")
        self.notes.add_if(len(scenes) > 1, f"of {len(scenes)} scenes the file's default, {index}, is drawn")
        return list(scenes[index].get("nodes", []))

    def _entry(self, table: str, index: object) -> dict[str, Any]:
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
        """Bytes behind a data URI or a file beside this one, whose name may be percent-encoded."""
        try:
            if uri.startswith("data:"):
                header, data = uri.split(",", 1)
                return base64.b64decode(data, validate=True) if header.endswith(";base64") else unquote_to_bytes(data)
            names = (uri, unquote(uri), unquote(uri).replace("\\", "/"))
            return read_bytes(next(filter(is_file, (self.path.parent / name for name in names)), self.path / uri))
        except (TilestampError, ValueError):
            raise TilestampError(f"{self.path.name}: cannot read {uri[:60] or 'an image without data'}") from None


def _split(path: Path) -> tuple[dict[str, Any], bytes]:
    """Take a file apart into its JSON tree and the binary chunk of a .glb."""
    data = read_bytes(path)
    if len(data) < 12 or struct.unpack_from("<I", data)[0] != MAGIC:
        return _tree(data), b""
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
    return _tree(chunks[JSON_CHUNK]), chunks.get(BINARY_CHUNK, b"")


def _tree(text: bytes) -> dict[str, Any]:
    tree: dict[str, Any] = json.loads(plain_text(text))
    if not isinstance(tree, dict) or not isinstance(tree.get("asset", {}), dict):
        raise ValueError("its JSON is not an object")  # noqa: TRY004 - the file is wrong, not a type
    return tree


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
