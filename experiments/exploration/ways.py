"""What the roads of one pipeline share: ways to draw patches, each with a name, and what a frame takes."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate

SIZE = (640, 480)  # pixels
MACHINES = ("gtx280", "h200")  # the paper's, and today's
MEGABYTE = 1e6


@dataclass(frozen=True, eq=False)
class Way:
    """A way to draw the teapot's patches, or a scene in clip space: options of the pipeline micropolygon."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene | None = None
    size: tuple[int, int] = SIZE

    @cache  # noqa: B019 - ways are constants
    def run(self, machine: str) -> Run:
        """A frame, counted and priced."""
        width, height = self.size
        view: dict[str, Any] = {"camera": np.eye(4)} if self.scene else {}
        shown = self.scene or "teapot"
        return simulate(shown, "micropolygon", machine, width=width, height=height, **view, **self.options)


def other_pixels(run: Run, base: Run) -> int:
    """Pixels that differ from those of another frame."""
    return int((run.image != base.image).any(axis=2).sum())


def megabytes(run: Run) -> float:
    """Buffers that a frame touches, each once, but the frame buffer."""
    sizes: dict[str, int] = {}
    for work in run.frame.works:
        for stream in work.streams:
            sizes[stream.buffer] = max(sizes.get(stream.buffer, 0), stream.footprint_bytes)
    return sum(size for name, size in sizes.items() if name != "framebuffer") / MEGABYTE


def milliseconds(run: Run, stages: Iterable[str]) -> float:
    """Time of some stages of a frame."""
    return float(run.stages["milliseconds"].reindex(list(stages)).fillna(0).sum())
