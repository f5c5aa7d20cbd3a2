"""What pricing a launch gives: time, the terms it was made of, and the one that holds."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Timing:
    """Price of one launch.

    Parameters
    ----------
    stage, kernel : str
    term_cycles : dict of str to float
        Cycles that each limit alone would take (see ``models.bounds``); ``launch`` comes on top of the largest.
    cycles, milliseconds : float
        Of the whole launch; NaN where only counts were asked for.
    bound : str
        The term that holds; ``balance`` (idle SMs) and ``tail`` (the last units) are seen by the schedule only.
    occupancy : float
        Share of the SM's warps that are resident, 0 for fixed function.
    achieved : float
        The same in the mean over the time in which an SM has any, by the schedule: few or uneven blocks fill no SM, and
        they start one after another. NaN where nothing was scheduled.
    dram_bytes, l2_bytes : float
        Moved to or from DRAM, and through L2.
    details : dict of str to float
        What else a fidelity has to say: ``busy_sms``, ``tail_cycles``, ``resident_blocks``.
    fidelity : str
        The level that priced it.
    low, high : float
        Milliseconds between which units that are in each other's way less or more often than expected put the launch
        (see ``models.schedule``); the same number where nothing spreads. It is no error of the model.
    residency : str
        Blocks that an SM holds, what keeps out one more, and the rounds in which such SMs take the grid's blocks: where
        the number of blocks, or the rounds rounded up, changes, a time may step.
    """

    stage: str
    kernel: str
    term_cycles: dict[str, float]
    cycles: float
    milliseconds: float
    bound: str
    occupancy: float
    dram_bytes: float
    l2_bytes: float
    details: dict[str, float] = field(default_factory=dict)
    fidelity: str = ""
    low: float = float("nan")
    high: float = float("nan")
    residency: str = ""
    achieved: float = float("nan")

    @property
    def terms(self) -> dict[str, float]:
        """``term_cycles`` in milliseconds."""
        return {
            name: self.milliseconds * cycles / self.cycles if cycles else 0.0
            for name, cycles in self.term_cycles.items()
        }
