"""A frame: what a pipeline made, before anything is priced."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.machine import Machine
from tilestamp.simulator.mixed import MixedWorks, mix_of
from tilestamp.simulator.work import FixedFunctionWork, Work

NOTHING = "nothing is visible: all of it is off screen, nearer or farther than the camera sees, culled or without area"


def remarks(sentences: Mapping[str, str], facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Say what was lost, repeated or left to chance: a sentence for each of some facts that counts any.

    A sentence has the fact's own number at ``{}``, and others by name.
    """
    return tuple(sentence.format(facts[fact], **facts) for fact, sentence in sentences.items() if facts.get(fact))


@dataclass(frozen=True, eq=False)
class Frame:
    """The picture of one pipeline and the work of its stages, in launch order.

    Parameters
    ----------
    image : ndarray, (H, W, 3), uint8
        Row 0 is the top row. Without pixels where only numbers were asked for: ``numbers``.
    depth : ndarray, (H, W)
        In the pipeline's own format: float32, 1 where nothing was drawn, or the original's uint32.
    works : sequence of Work or FixedFunctionWork
        One for each kernel launch.
    triangle_ids : ndarray, (H, W), int32, or None
        Input index of the visible triangle, -1 where nothing was drawn.
    maps : dict of str to ndarray
        Heat maps by counter, a cell a tile or a pixel; row 0 on top.
    facts : dict
        What a report may say besides: queue lengths, memory, retries, what was given up.
    warnings : tuple of str
        Sentences on what the picture lacks or shows wrong.
    tile : int, or tuple of two
        Pixels on a side of a tile, or its width and height, for maps that have a cell a tile.
    tiles_from_below : bool
        Whether tiles begin at the bottom row: a height that is no multiple of theirs then cuts the top row.
    buffers : dict of str to ndarray
        What kernels hand on, by name, where a pipeline keeps it for those who look inside.
    """

    image: NDArray[np.uint8]
    depth: NDArray[Any]
    works: Sequence[Work | FixedFunctionWork]
    triangle_ids: NDArray[np.int32] | None = None
    maps: dict[str, NDArray[Any]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    tile: int | tuple[int, int] = 1
    tiles_from_below: bool = False
    buffers: dict[str, NDArray[Any]] = field(default_factory=dict, repr=False)
    _mixed: dict[tuple[str, str, int], MixedWorks] = field(default_factory=dict, init=False, repr=False, compare=False)

    def mixed(self, pipeline: str, machine: Machine) -> MixedWorks:
        """Its works by the mix of a pipeline for a machine, made once for all machines of that mix.

        Raises
        ------
        TilestampError
            No mix.
        """
        mix, warp = mix_of(self.works, pipeline, machine), machine.sm.warp_size
        key = (mix.name, mix.digest, warp) if mix else ("", "", warp)
        return self._mixed.setdefault(key, MixedWorks(self.works, mix, warp))

    @property
    def remarks(self) -> tuple[str, ...]:
        """The warnings, and whether there is nothing to be seen."""
        return ((NOTHING,) if self.shows_nothing else ()) + self.warnings

    @property
    def shows_nothing(self) -> bool:
        """Whether no pixel shows anything of the scene; without a picture, whether no sample was hit."""
        if self.triangle_ids is not None:
            return not (self.triangle_ids >= 0).any()
        if self.depth.size and self.depth.dtype == np.float32:
            return not (self.depth != 1).any()
        hits = [work.counts()["SAMPLE_HITS"] for work in self.works if "SAMPLE_HITS" in work.counts()]
        return bool(hits) and not any(hits)

    @classmethod
    def numbers(
        cls, works: Sequence[Work | FixedFunctionWork], facts: dict[str, Any], warnings: tuple[str, ...] = ()
    ) -> "Frame":
        """Make a frame of which only the numbers were asked for."""
        nothing = np.empty((0, 0, 3), np.uint8)
        return cls(nothing, np.empty((0, 0), np.float32), works, facts=facts, warnings=warnings)
