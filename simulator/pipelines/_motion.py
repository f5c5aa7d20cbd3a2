"""What interval and interleaved share: shutter and lens, the micropolygons as they move, and how they are shaded."""

from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines._micropolygons import DicedInput
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons, micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import BlurPattern, MovingMicropolygons, blur_samples, moved
from tilestamp.simulator.stages.fatahalian2009.thin_lens import defocus
from tilestamp.simulator.stages.ragankelley2011.decoupled_shading import Shading, decoupled_shading


class MotionInput(DicedInput, frozen=True, kw_only=True):
    """Micropolygons behind a shutter and a thin lens."""

    spp: Annotated[int, Meta(ge=1, le=16)] = 4
    """Samples a pixel, each at a time and a lens point of its own."""
    motion: Annotated[float, Meta(ge=0, le=4096)] = 8.0
    """Pixels that the scene moves on screen while the shutter is open."""
    direction: float = 0.0
    """Where to, in degrees from the right, counter-clockwise."""
    lens: Annotated[float, Meta(ge=0, le=4096)] = 8.0
    """Radius in pixels of the circle of confusion of what is infinitely far: 0 is a pinhole."""
    focus: Annotated[float, Meta(gt=0)] | None = None
    """Distance from the eye of what is sharp, in model units; none: the mean of the vertices."""
    shade_cache: Annotated[int, Meta(ge=1, le=1024)] | None = None
    """Shade visible samples, and keep so many shading cells for others to share; none: shading is no part of the
    frame."""
    shading_rate: Annotated[float, Meta(gt=0, le=16)] = 1.0
    """Shading cells along a pixel."""
    decoupled: bool = True
    """Samples share the cell where their point lies at rest, seen through the middle of the lens; or that of their own
    pixel, as multisampling does."""


def moving_micropolygons(
    scene: Scene, matrix: NDArray[Any], width: int, height: int, options: MotionInput
) -> tuple[Micropolygons, MovingMicropolygons]:
    """Dice the scene as it stands when the shutter opens, and let it move."""
    still = micropolygons(scene, matrix, width, height, options.edge, options.triangles)
    flat = scene.mesh is not None and scene.mesh.clip_space
    blur = defocus(still, np.eye(4) if flat else matrix, width, height, options.focus, options.lens)
    angle = np.radians(options.direction)
    return still, moved(still, options.motion * np.array([np.cos(angle), -np.sin(angle)]), blur)


def shade(
    execute: Executor,
    moving: MovingMicropolygons,
    pattern: BlurPattern,
    options: MotionInput,
    samples: Samples,
    simt: Simt,
) -> None:
    """Shade the visible samples, where that is part of the frame."""
    if options.shade_cache is not None:
        shading = Shading(options.shading_rate, options.shade_cache, options.decoupled)
        again = blur_samples(samples.width, samples.height, pattern)
        execute(decoupled_shading, moving, pattern, again, shading, simt)
