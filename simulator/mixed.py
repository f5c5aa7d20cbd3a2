"""Works by a mix: what a frame's stages did, in machine events."""

from collections.abc import Sequence

from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine
from tilestamp.models.remembered import priced_property
from tilestamp.simulator.mix import Mix, load_mix
from tilestamp.simulator.work import FixedFunctionWork, Work


def mix_of(works: Sequence[Work | FixedFunctionWork], pipeline: str, machine: Machine) -> Mix | None:
    """The mix that prices works on a machine; None where all is fixed function."""
    counted = any(isinstance(work, Work) for work in works)
    return load_mix(pipeline, machine.compute_capability) if counted else None


class MixedWorks:
    """Works by one mix.

    Parameters
    ----------
    works : sequence of Work or FixedFunctionWork
    mix : Mix or None
        None where all is fixed function.
    warp : int
        Lanes in a warp.
    """

    def __init__(self, works: Sequence[Work | FixedFunctionWork], mix: Mix | None, warp: int) -> None:
        self.works, self.mix, self.warp = works, mix, warp

    @priced_property
    def launches(self) -> list[Launch | PipeLaunch]:
        """One for each kernel launch, in machine events."""
        return [self.launch(work) if isinstance(work, Work) else work.launch() for work in self.works]

    def launch(self, work: Work) -> Launch:
        """Price the events of one of them in instructions, or those of others."""
        assert self.mix is not None  # noqa: S101 - there is a Work
        return self.mix.launch(work, self.warp)
