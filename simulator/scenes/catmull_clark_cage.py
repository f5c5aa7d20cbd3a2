"""What a cage must be before it is subdivided: checked, cleaned of isolated vertices, wound one way, creased."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.quad_cage import Cage, Indices


def check_cage(cage: Cage) -> None:
    """Refuse what is no surface; the sentence names the first offender (1-based, as OBJ files count)."""
    if len(cage.sizes) == 0:
        raise TilestampError("the cage has no faces")
    if (cage.sizes < 3).any():
        face = int((cage.sizes < 3).argmax())
        raise TilestampError(f"the cage's face {face + 1} has {cage.sizes[face]} corners; a face needs three")
    if cage.corners.min() < 0 or cage.corners.max() >= len(cage.positions):
        raise TilestampError(f"a face of the cage names a vertex beyond its {len(cage.positions)} vertices")
    if not np.isfinite(cage.positions[cage.corners]).all():
        raise TilestampError("a vertex of the cage is NaN or infinite")
    keys = np.sort(cage.face_of_corner * len(cage.positions) + cage.corners)
    if (keys[1:] == keys[:-1]).any():
        face = int(keys[:-1][keys[1:] == keys[:-1]][0]) // len(cage.positions)
        raise TilestampError(f"the cage's face {face + 1} has the same vertex twice")
    faces = np.bincount(cage.edge_of_corner)
    if (faces > 2).any():
        a, b = cage.edges[int((faces > 2).argmax())] + 1
        raise TilestampError(f"{faces.max()} faces of the cage meet at the edge {a}-{b}; a surface has two at most")


def cleaned_cage(cage: Cage) -> tuple[Cage, Indices]:
    """Drop isolated vertices and turn faces round that are wound against their neighbours.

    Returns
    -------
    Cage
    ndarray, (V,), int64
        New number of each vertex, -1 where it was dropped.
    """
    used = np.zeros(len(cage.positions), dtype=bool)
    used[cage.corners] = True
    kept = np.where(used, np.cumsum(used) - 1, -1)
    corners = kept[cage.corners]
    offsets = np.concatenate([[0], np.cumsum(cage.sizes)])
    beside = _face_pairs(cage)
    forwards = cage.corners == cage.edges[cage.edge_of_corner, 0]
    turned, one_sided = _turned_faces(offsets, cage.edge_of_corner, beside, forwards)
    if one_sided:
        raise TilestampError("the cage is a one-sided surface (a Moebius strip): its faces cannot be wound one way")
    for face in np.flatnonzero(turned):
        corners[offsets[face] : offsets[face + 1]] = corners[offsets[face] : offsets[face + 1]][::-1]
    return Cage(cage.positions[used].astype(np.float64), corners, cage.sizes), kept


def edge_sharpness(cage: Cage, kept: Indices, creases: Indices, sharpness: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sharpness of each edge: infinite on boundaries, as given on creases, else 0."""
    if len(creases) != len(sharpness):
        raise TilestampError(f"{len(creases)} creases have {len(sharpness)} values of sharpness")
    if len(sharpness) and not (sharpness >= 0).all():
        raise TilestampError("the sharpness of a crease is not negative")
    sharp = np.where(cage.boundary_edges, np.inf, 0.0).astype(np.float32)
    vertices = len(cage.positions)
    keys = cage.edges[:, 0] * vertices + cage.edges[:, 1]  # sorted: edges are unique keys in order
    for (a, b), value in zip(creases, sharpness, strict=True):
        inside = min(a, b) >= 0 and max(a, b) < len(kept) and min(kept[a], kept[b]) >= 0
        key = min(kept[a], kept[b]) * vertices + max(kept[a], kept[b]) if inside else -1
        place = int(np.searchsorted(keys, key))
        if place == len(keys) or keys[place] != key:
            raise TilestampError(f"the crease {a + 1}-{b + 1} is no edge of the cage")
        sharp[place] = max(sharp[place], value)
    return sharp


def _face_pairs(cage: Cage) -> Indices:
    """Give the corners at each edge, (E, 2); -1 where there is no second."""
    order = np.argsort(cage.edge_of_corner, kind="stable")
    edge = cage.edge_of_corner[order]
    first = np.r_[True, edge[1:] != edge[:-1]]
    pairs = np.full((len(cage.edges), 2), -1, np.int64)
    pairs[edge[first], 0] = order[first]
    pairs[edge[~first], 1] = order[~first]
    return pairs


@kernel
def _turned_faces(offsets: Any, corner_edges: Any, beside: Any, forwards: Any) -> tuple[Any, bool]:
    """Flood each component from its first face: which faces to turn, and whether that contradicts itself."""
    faces = len(offsets) - 1
    face_of = np.empty(len(corner_edges), np.int64)
    for f in range(faces):
        face_of[offsets[f] : offsets[f + 1]] = f
    state = np.full(faces, -1, np.int8)  # 1: turned
    stack = np.empty(faces, np.int64)
    for root in range(faces):
        if state[root] >= 0:
            continue
        state[root] = 0
        stack[0] = root
        waiting = 1
        while waiting:
            waiting -= 1
            f = stack[waiting]
            for c in range(offsets[f], offsets[f + 1]):
                pair = beside[corner_edges[c]]
                other = pair[0] + pair[1] - c
                if pair[1] < 0:
                    continue
                wanted = state[f] ^ np.int8(forwards[c] == forwards[other])
                g = face_of[other]
                if state[g] < 0:
                    state[g] = wanted
                    stack[waiting] = g
                    waiting += 1
                elif state[g] != wanted:
                    return state == 1, True
    return state == 1, False
