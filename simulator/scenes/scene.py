"""A scene: patches, triangles or splats, and the cameras that they are known by."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from tilestamp.simulator.scenes.camera import Camera, ModelToClip
from tilestamp.simulator.scenes.clip_space import clip_space_mesh
from tilestamp.simulator.scenes.geometry import Mesh, Patches
from tilestamp.simulator.scenes.splats import Splats, make_splats
from tilestamp.simulator.scenes.sweep import sweep_mesh

__all__ = ["Mesh", "Patches", "Scene", "Splats", "clip_space_scene"]


@dataclass(frozen=True)
class Scene:
    """What a pipeline draws: ``patches`` or a ``mesh`` (or both), or ``splats``; and named ``views``."""

    name: str
    patches: Patches | None = None
    mesh: Mesh | None = None
    splats: Splats | None = None
    views: Mapping[str, Camera] = field(default_factory=dict)
    note: str = ""  # what its reader skipped, guessed or could not represent; or that it is a stand-in

    @classmethod
    def from_clip_space(cls, positions: ArrayLike, triangles: ArrayLike, name: str = "clip-space mesh") -> "Scene":
        """Make a scene of clip-space positions (V, 4) and triangles (F, 3), which go straight to triangle setup.

        Raises TilestampError where positions are not finite, triangles name vertices that do not exist, or are none.
        """
        return clip_space_scene(clip_space_mesh(positions, triangles, name), name)

    @classmethod
    def from_splats(
        cls,
        means: ArrayLike,
        scales: ArrayLike,
        rotations: ArrayLike,
        opacities: ArrayLike,
        colours: ArrayLike,
        name: str = "splats",
    ) -> "Scene":
        """Make a scene of 3D Gaussians, rounded to float32 and otherwise taken as they are.

        Parameters
        ----------
        means, scales : array-like, (N, 3)
            Centres, and standard deviations along the own axes.
        rotations : array-like, (N, 4)
            Quaternions w x y z, which are not normalized.
        opacities : array-like, (N,)
            0 to 1.
        colours : array-like, (N, 3)
            Red, green, blue, the same from all sides.

        Raises
        ------
        TilestampError
            They do not fit together, are no numbers, or are none.
        """
        return cls(name, splats=make_splats(means, scales, rotations, opacities, colours))

    @classmethod
    def sweep(cls, area: float, width: int = 1024, height: int = 768, seed: int = 0) -> "Scene":
        """Make the synthetic triangles of one area, in pixels, of Figure 5 (Laine & Karras 2011); see `sweep`."""
        return clip_space_scene(sweep_mesh(area, width, height, seed), f"sweep {area:g} px")


def clip_space_scene(mesh: Mesh, name: str) -> Scene:
    """Give a clip-space mesh as a scene; its only view leaves it where it is."""
    return Scene(name, mesh=mesh, views={"default": ModelToClip(np.eye(4))})
