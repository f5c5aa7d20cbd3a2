"""What the micropolygon pipelines of 2009 and 2012 share: options of their input, and their picture as a frame."""

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from tilestamp.simulator.frame import Frame, remarks
from tilestamp.simulator.options import Options
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, picture, visible
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.work import FixedFunctionWork, Work

REMARKS = {
    "dropped_polygons": "{:,} micropolygons across the eye's plane, or not finite, are not drawn",
    "wrong_pixels": "{:,} pixels show another micropolygon than without the mask",
}


class DicedInput(Options, frozen=True, kw_only=True):
    """How many micropolygons there are."""

    maps: ClassVar[dict[str, str]] = {
        "tests": "sample tests at a pixel",
        "micropolygons": "number of the micropolygon that a pixel shows",
    }
    edge: Annotated[float, Meta(gt=0)] = 1.0
    """Micropolygons of patches have edges of at most so many pixels."""
    triangles: bool = False
    """Split micropolygons into triangles."""


class MicropolygonInput(DicedInput, frozen=True, kw_only=True):
    """Micropolygons, and samples to test them at."""

    spp: Annotated[int, Meta(ge=1, le=16)] = 1
    """Samples a pixel."""
    positions: str | None = None
    """File of sample positions (TOML), in place of the standard ones."""


def frame_of(
    samples: Samples, polygons: Micropolygons, works: Sequence[Work | FixedFunctionWork], **facts: Any
) -> Frame:
    """Gather a frame: the picture, the nearest depth of each pixel's first sample, ids of patches or triangles."""
    depth = samples.depth.reshape(samples.height, samples.width, -1)[:, :, 0]
    found = {"micropolygons": len(polygons.patch), "dropped_polygons": polygons.dropped} | facts
    return Frame(
        image=picture(samples, polygons),
        depth=np.where(np.isinf(depth), np.float32(1.0), depth),
        works=works,
        triangle_ids=visible(samples, polygons.patch),
        maps={"tests": samples.tests, "micropolygons": visible(samples)},
        facts=found,
        warnings=remarks(REMARKS, found),
    )


def wrong_pixels(samples: Samples, exact: Samples) -> NDArray[np.bool_]:
    """Pixels, (H, W), with a sample that shows another micropolygon than the exact picture."""
    wrong: NDArray[np.bool_] = (samples.polygon != exact.polygon).reshape(samples.height, samples.width, -1).any(axis=2)
    return wrong
