"""What the roads of one pipeline share: ways to draw the teapot, each with a name, and what a frame takes."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

SIZE = (640, 480)  # pixels
MACHINES = ("gtx280", "h200")  # the paper's, and today's
MEGABYTE = 1e6


@dataclass(frozen=True, eq=False)
class Way:
    """A way to draw the teapot's patches: options of the pipeline micropolygon."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)

    @cache  # noqa: B019 - ways are constants
    def run(self, machine: str) -> Run:
        """A frame, counted and priced."""
        return simulate("teapot", "micropolygon", machine, width=SIZE[0], height=SIZE[1], **self.options)


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
