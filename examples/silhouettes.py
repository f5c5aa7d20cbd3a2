"""Compare two shapes by their silhouettes: intersection over union and the area where they differ, antialiased.

``python examples/silhouettes.py [-o PICTURE.png]``: a sphere of more and more triangles beside the finest.
"""

import argparse

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tilestamp.simulator import nvdiffrast as dr

SIZE = 256


def sphere(rings: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Clip positions (1, V, 4) and triangles of a sphere of so many rings, seen along z."""
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False), indexing="ij"
    )
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    pos = np.column_stack([0.8 * unit, np.ones(len(unit))]).astype(np.float32)
    columns = 2 * rings
    i, j = (n.reshape(-1) for n in np.meshgrid(np.arange(rings), np.arange(columns), indexing="ij"))
    a, b = i * columns + j, i * columns + (j + 1) % columns
    tri = np.concatenate([np.stack([a, b, a + columns], -1), np.stack([b, b + columns, a + columns], -1)])
    return pos[None], tri.astype(np.int32)


def silhouette(pos: NDArray[np.float32], tri: NDArray[np.int32]) -> NDArray[np.float32]:
    """Share of each pixel that the shape covers, (SIZE, SIZE)."""
    rast, _ = dr.rasterize(pos, tri, (SIZE, SIZE))
    covered = (rast[..., 3:] > 0).astype(np.float32)
    return dr.antialias(covered, rast, pos, tri)[0, ..., 0]


def compare(a: NDArray[np.float32], b: NDArray[np.float32]) -> tuple[float, float]:
    """Intersection over union, and the area that only one covers, in pixels."""
    return float(np.minimum(a, b).sum() / np.maximum(a, b).sum()), float(np.abs(a - b).sum())


def main() -> None:
    """Print the table, and write the last difference."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", help="picture of the difference between 6 rings and the finest")
    output = parser.parse_args().output
    finest = silhouette(*sphere(96))
    for rings in (4, 6, 12, 24, 48):
        overlap, area = compare(silhouette(*sphere(rings)), finest)
        print(f"{rings:3d} rings: intersection over union {overlap:.4f}, {area:8.1f} pixels differ")
    if output:
        difference = np.abs(silhouette(*sphere(6)) - finest)[::-1]
        Image.fromarray((255 * difference).astype(np.uint8)).save(output)


if __name__ == "__main__":
    main()
