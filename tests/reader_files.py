"""Small files of every kind, as texts and bytes, that the tests of readers write and change."""

import base64
import struct

import numpy as np
from PIL import Image

SQUARE = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
TEXTURED = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
MARK = b"\xef\xbb\xbf"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
UVS = np.array([[[0, 0], [1, 0], [0, 1], [1, 1]], [[0.25, 0.5]] * 4], np.float32)


def png(path, color=(255, 0, 0)):
    Image.new("RGB", (2, 2), color).save(path)


def area(mesh):
    a, b, c = (mesh.positions[mesh.triangles[:, k], :3].astype(float) for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def stl(count, facets, *, header=b"", attribute=0):
    facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, attribute)
    return header.ljust(80, b"\0") + struct.pack("<I", count) + facet * facets


def gltf(change=None):
    """Four points, drawn as a list of their first three; ``change`` edits the tree."""
    data = POINTS.tobytes() + UVS.tobytes() + np.array([0, 1, 2], np.uint16).tobytes()
    accessor = {"componentType": 5126, "count": 4}
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2}, "indices": 3}]}],
        "accessors": [
            {**accessor, "bufferView": 0, "type": "VEC3"},
            {**accessor, "bufferView": 1, "type": "VEC2"},
            {**accessor, "bufferView": 1, "byteOffset": 32, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 64},
            {"buffer": 0, "byteOffset": 112, "byteLength": 6},
        ],
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    if change:
        change(tree)
    return tree
