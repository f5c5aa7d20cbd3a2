"""One Catmull-Clark step and the limit masks, as plain loops (Catmull & Clark 1978; DeRose et al. 1998 for creases)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel

CORNER = 3  # sharp edges at a vertex from which on it is a corner and stays


@kernel
def step(
    positions: Any, offsets: Any, corners: Any, corner_edges: Any, edges: Any, sharpness: Any, cage_face: Any
) -> tuple[Any, ...]:
    """Refine a surface once; takes and returns the fields of a ``Surface``."""
    vertices, faces = len(positions), len(offsets) - 1
    points = np.empty((vertices + len(edges) + faces, 3))
    beside = np.zeros((len(edges), 3))  # sum of the face points at an edge
    around = np.zeros((vertices, 3))  # sum of the face points at a vertex
    count = np.zeros(vertices, np.int32)
    first_face = vertices + len(edges)
    for f in range(faces):
        size = offsets[f + 1] - offsets[f]
        for d in range(3):
            total = 0.0
            for c in range(offsets[f], offsets[f + 1]):
                total += positions[corners[c], d]
            total /= size
            points[first_face + f, d] = total
            for c in range(offsets[f], offsets[f + 1]):
                beside[corner_edges[c], d] += total
                around[corners[c], d] += total
        for c in range(offsets[f], offsets[f + 1]):
            count[corners[c]] += 1
    _edge_points(positions, edges, sharpness, beside, points)
    _vertex_points(positions, edges, sharpness, around, count, points)
    quads, quad_edges, new_faces = _new_faces(vertices, first_face, offsets, corners, corner_edges, edges, cage_face)
    new_edges, new_sharpness = _new_edges(vertices, first_face, offsets, corner_edges, edges, sharpness)
    new_offsets = np.arange(0, len(quads) + 1, 4).astype(np.int32)
    return points, new_offsets, quads, quad_edges, new_edges, new_sharpness, new_faces


@kernel
def _edge_points(positions: Any, edges: Any, sharpness: Any, beside: Any, points: Any) -> None:
    """Smooth: mean of both ends and both face points; sharp: the middle; between 0 and 1: between the two."""
    for e in range(len(edges)):
        a, b = edges[e]
        sharp = min(sharpness[e], np.float32(1.0))
        for d in range(3):
            middle = 0.5 * (positions[a, d] + positions[b, d])
            if sharp >= 1.0:
                points[len(positions) + e, d] = middle
            else:
                smooth = 0.25 * (positions[a, d] + positions[b, d] + beside[e, d])
                points[len(positions) + e, d] = sharp * middle + (1.0 - sharp) * smooth


@kernel
def _sharp_ends(positions: Any, edges: Any, sharpness: Any) -> tuple[Any, Any, Any]:
    """Of each vertex: sharp edges, boundary edges, sum of their sharpness (each at most 1), sum of their far ends."""
    sharp = np.zeros((len(positions), 2), np.int32)
    softness = np.zeros(len(positions))
    far = np.zeros((len(positions), 3))
    for e in range(len(edges)):
        if sharpness[e] > 0.0:
            for end in range(2):
                v, other = edges[e, end], edges[e, 1 - end]
                sharp[v, 0] += 1
                sharp[v, 1] += sharpness[e] == np.inf
                softness[v] += min(sharpness[e], np.float32(1.0))
                for d in range(3):
                    far[v, d] += positions[other, d]
    return sharp, softness, far


@kernel
def _vertex_points(positions: Any, edges: Any, sharpness: Any, around: Any, count: Any, points: Any) -> None:
    """Smooth: (F + 2 R + (n - 3) P) / n; on a crease (1, 6, 1) / 8; at a corner P."""
    vertices = len(positions)
    spokes = np.zeros((vertices, 3))  # sum of the far ends of all edges
    valence = np.zeros(vertices, np.int32)
    for e in range(len(edges)):
        a, b = edges[e]
        valence[a] += 1
        valence[b] += 1
        for d in range(3):
            spokes[a, d] += positions[b, d]
            spokes[b, d] += positions[a, d]
    sharp, softness, far = _sharp_ends(positions, edges, sharpness)
    for v in range(vertices):
        n = float(valence[v])
        corner = sharp[v, 0] >= CORNER or (count[v] == 1 and sharp[v, 1] == 2)
        crease = sharp[v, 0] == 2 or corner
        weight = softness[v] / sharp[v, 0] if crease else 0.0
        for d in range(3):
            p = positions[v, d]
            smooth = p
            if weight < 1.0:
                middles = 0.5 * (n * p + spokes[v, d]) / n
                smooth = (around[v, d] / count[v] + 2.0 * middles + (n - 3.0) * p) / n
            held = p if corner else (6.0 * p + far[v, d]) / 8.0
            points[v, d] = weight * held + (1.0 - weight) * smooth if crease else smooth


@kernel
def _new_faces(
    vertices: int, first_face: int, offsets: Any, corners: Any, corner_edges: Any, edges: Any, cage_face: Any
) -> tuple[Any, Any, Any]:
    """Make a quad of each corner: the corner, the next edge's point, the face point, the edge point before."""
    quads = np.empty(4 * len(corners), np.int32)
    quad_edges = np.empty(4 * len(corners), np.int32)
    faces = np.empty(len(corners), np.int32)
    spokes = 2 * len(edges)
    for f in range(len(offsets) - 1):
        before = offsets[f + 1] - 1
        for c in range(offsets[f], offsets[f + 1]):
            out, back = corner_edges[c], corner_edges[before]
            quads[4 * c] = corners[c]
            quads[4 * c + 1] = vertices + out
            quads[4 * c + 2] = first_face + f
            quads[4 * c + 3] = vertices + back
            quad_edges[4 * c] = 2 * out + (edges[out, 0] != corners[c])
            quad_edges[4 * c + 1] = spokes + c
            quad_edges[4 * c + 2] = spokes + before
            quad_edges[4 * c + 3] = 2 * back + (edges[back, 0] != corners[c])
            faces[c] = cage_face[f]
            before = c
    return quads, quad_edges, faces


@kernel
def _new_edges(
    vertices: int, first_face: int, offsets: Any, corner_edges: Any, edges: Any, sharpness: Any
) -> tuple[Any, Any]:
    """Two halves of each edge, a step less sharp, and a smooth spoke for each face corner."""
    halves = 2 * len(edges)
    new_edges = np.empty((halves + len(corner_edges), 2), np.int32)
    new_sharpness = np.zeros(len(new_edges), np.float32)
    for e in range(len(edges)):
        for end in range(2):
            new_edges[2 * e + end, 0] = edges[e, end]
            new_edges[2 * e + end, 1] = vertices + e
            new_sharpness[2 * e + end] = max(sharpness[e] - np.float32(1.0), np.float32(0.0))
    for f in range(len(offsets) - 1):
        for c in range(offsets[f], offsets[f + 1]):
            new_edges[halves + c, 0] = vertices + corner_edges[c]
            new_edges[halves + c, 1] = first_face + f
    return new_edges, new_sharpness


@kernel
def limit_points(positions: Any, quads: Any, edges: Any, sharpness: Any) -> Any:
    """Limit of each vertex: (n^2 P + 4 E + F) / (n (n + 5)), on a crease (1, 4, 1) / 6, at a corner P."""
    vertices = len(positions)
    ring = np.zeros((vertices, 3))  # 4 x far ends of the edges + opposite corners of the quads
    count = np.zeros((vertices, 2), np.int32)  # edges, faces
    for e in range(len(edges)):
        for end in range(2):
            v, other = edges[e, end], edges[e, 1 - end]
            count[v, 0] += 1
            for d in range(3):
                ring[v, d] += 4.0 * positions[other, d]
    for f in range(len(quads)):
        for k in range(4):
            v, other = quads[f, k], quads[f, (k + 2) % 4]
            count[v, 1] += 1
            for d in range(3):
                ring[v, d] += positions[other, d]
    sharp, _, far = _sharp_ends(positions, edges, sharpness)
    limits = np.empty((vertices, 3))
    for v in range(vertices):
        n = float(count[v, 0])
        corner = sharp[v, 0] >= CORNER or (count[v, 1] == 1 and sharp[v, 1] == 2)
        for d in range(3):
            p = positions[v, d]
            if corner:
                limits[v, d] = p
            elif sharp[v, 0] == 2:
                limits[v, d] = (4.0 * p + far[v, d]) / 6.0
            else:
                limits[v, d] = (n * n * p + ring[v, d]) / (n * (n + 5.0))
    return limits
