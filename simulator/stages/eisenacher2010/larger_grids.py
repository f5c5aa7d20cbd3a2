"""Grids of more than 4x4 vertices, which shade less for each quad (future work of Eisenacher & Loop 2010, section 5).

"Tessellating into 4x4 grids introduces a lot of redundant shading for the edge vertices": 16 vertices for 9 quads are
1.78, 25 for 16 quads 1.56, 169 for 144 quads 1.17. A larger grid is put together here from squares of 4x4 vertices some
halvings deeper, or from every third vertex of those: so its vertices are computed as all others are, and neighbours
have the same ones along their edge.
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches

GridSide = Literal[4, 5, 7, 9, 13]
GRID_SIDES: tuple[GridSide, ...] = get_args(GridSide)
HALVINGS = {4: 0, 5: 2, 7: 1, 9: 3, 13: 2}  # of a sub-patch into squares of 4x4 vertices
STEPS = {4: 1, 5: 3, 7: 1, 9: 3, 13: 1}  # vertices of those squares from one of the grid to the next
DEEPEST = 16  # halvings that the place of a square has bits for


def squares(subpatches: SubPatches, side: GridSide) -> SubPatches:
    """Cut sub-patches into the squares that hold the vertices of their grids, row by row.

    Raises
    ------
    TilestampError
        Sub-patches that are too small for that.
    """
    halvings = HALVINGS[side]
    if len(subpatches.level) and int(subpatches.level.max()) + halvings > DEEPEST:
        raise TilestampError(f"sub-patches after {subpatches.level.max()} halvings are too small for grid {side}")
    row, column = (place.reshape(-1).astype(np.uint16) for place in np.mgrid[: 1 << halvings, : 1 << halvings])
    i, j = ((place[:, None] << halvings) + one for place, one in ((subpatches.i, column), (subpatches.j, row)))
    patch, level = (np.repeat(array, len(row)) for array in (subpatches.patch, subpatches.level + np.uint8(halvings)))
    return SubPatches(patch, level, i.astype(np.uint16).reshape(-1), j.astype(np.uint16).reshape(-1), subpatches.passes)


def joined(vertices: NDArray[np.float32], side: GridSide) -> NDArray[np.float32]:
    """Put the grids of ``squares`` together: (N, side**2, 4) of their (N * squares, 16, 4) vertices."""
    cells, step = 1 << HALVINGS[side], STEPS[side]
    parts = vertices.reshape(-1, cells, cells, 4, 4, 4)
    whole = np.empty((len(parts), 3 * cells + 1, 3 * cells + 1, 4), np.float32)
    for j, i in np.ndindex(cells, cells):
        whole[:, 3 * j : 3 * j + 4, 3 * i : 3 * i + 4] = parts[:, j, i]
    return np.ascontiguousarray(whole[:, ::step, ::step].reshape(-1, side**2, 4))
