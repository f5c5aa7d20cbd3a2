"""The forward pass of cube fitting, an exercise of nvdiffrast's users: how far a guessed cube's picture is off.

``python examples/cube_fitting.py``: a cube whose corners and colours are off by more and more, drawn at 16x16 pixels
from random directions. The error is what an optimizer would follow; gradients are not computed.
"""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator import nvdiffrast as dr

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TRIANGLES = np.array([[a, b, c] for p, q, r, s in SIDES for a, b, c in ((p, q, r), (p, r, s))], np.int32)
COLOURS = ((CORNERS + 1) / 2).astype(np.float32)


def camera(rng: np.random.Generator) -> NDArray[np.float32]:
    """Model-to-clip matrix of a random direction, three and a half units away."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    view = np.eye(4)
    view[:3, :3], view[2, 3] = turn, -3.5
    near, far, scale = 0.1, 20.0, 2.0
    projection = np.diag([scale, scale, (far + near) / (near - far), 0.0])
    projection[2, 3], projection[3, 2] = 2 * far * near / (near - far), -1.0
    return (projection @ view).astype(np.float32)


def render(
    matrices: NDArray[np.float32], corners: NDArray[np.float32], colours: NDArray[np.float32], pixels: int
) -> NDArray[np.float32]:
    """Draw the cube once for each matrix: rasterize, interpolate, antialias; (B, pixels, pixels, 3) float32."""
    points = np.column_stack([corners, np.ones(len(corners), np.float32)])
    pos = np.ascontiguousarray(points @ matrices.transpose(0, 2, 1))
    rast, _ = dr.rasterize(pos, TRIANGLES, (pixels, pixels))
    color, _ = dr.interpolate(colours, rast, TRIANGLES)
    return dr.antialias(color, rast, pos, TRIANGLES)


def errors(offsets: tuple[float, ...], views: int = 64, pixels: int = 16, seed: int = 0) -> dict[float, float]:
    """Mean squared difference of the pictures, by how far corners and colours are off."""
    rng = np.random.default_rng(seed)
    matrices = np.stack([camera(rng) for _ in range(views)])
    wanted = render(matrices, CORNERS, COLOURS, pixels)
    off, other = rng.normal(size=CORNERS.shape), rng.normal(size=COLOURS.shape)
    found = {}
    for offset in offsets:
        guess = render(
            matrices,
            (CORNERS + offset * off).astype(np.float32),
            np.clip(COLOURS + offset * other, 0, 1).astype(np.float32),
            pixels,
        )
        found[offset] = float(((guess - wanted) ** 2).mean())
    return found


if __name__ == "__main__":
    for offset, error in errors((0.4, 0.2, 0.1, 0.05, 0.02, 0.0)).items():
        print(f"corners and colours off by {offset:4.2f}: mean squared error {error:.6f}")
