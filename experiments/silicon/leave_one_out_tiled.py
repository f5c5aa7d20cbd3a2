"""One scene left out of the fit of Ru's tiled raster: its two chains fitted to the times of the others predict it.

The chains are a list entry's and a hit's (``textured_mix.CHAINS``). Each is tried at ``TRIED`` times its value in the
mix, both against each other; the pair with the least squared error of the other scenes is taken.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Cell
from tilestamp.experiments.silicon.textured_inputs import TIME_METRIC, measured_scenes, read_measured
from tilestamp.experiments.silicon.textured_ru import KERNELS, drawn_frames
from tilestamp.experiments.validation.quantities import TIME_AIM
from tilestamp.models.events import MachineEvent
from tilestamp.models.price import price
from tilestamp.models.traffic import traffic
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.run import Run
from tilestamp.simulator.work import Work

STAGE = "tiled_raster"
TRIED = np.linspace(0.6, 1.4, 9)
PAIRS = tuple(product(range(len(TRIED)), repeat=2))


@dataclass(frozen=True)
class Timed:
    """One measured launch.

    Parameters
    ----------
    scene, config : str
    measured : float
        Microseconds.
    ours : ndarray, (len(PAIRS),), float64
        Microseconds with each pair of chains.
    """

    scene: str
    config: str
    measured: float
    ours: NDArray[np.float64]


def tiled_cells(say: Callable[[str], None]) -> list[Cell]:
    """Cells of each scene, predicted from the others.

    Raises
    ------
    MissingInputError
        The measurements are not at hand.
    """
    timed = [each for name in measured_scenes("ru") for each in _timed(name, say)]
    return left_out(timed)


def left_out(timed: list[Timed]) -> list[Cell]:
    """Predict each scene with the pair of chains that suits the others best."""
    cells = []
    for scene in dict.fromkeys(each.scene for each in timed):
        errors = np.stack([each.ours / each.measured - 1.0 for each in timed if each.scene != scene])
        best = int(np.argmin((errors**2).sum(axis=0)))
        cells += [
            Cell(
                f"{scene} {each.config}", f"{KERNELS[STAGE]} time", "us",
                published=each.measured, ours=float(each.ours[best]), aim=TIME_AIM,
            )
            for each in timed
            if each.scene == scene
        ]  # fmt: skip
    return cells


def _timed(name: str, say: Callable[[str], None]) -> Iterator[Timed]:
    """Draw one scene's tiled frames, and price their rasters with each pair of chains."""
    measured = read_measured(name)
    for drawn in drawn_frames(measured):
        if drawn.config.startswith("tiled"):
            say(f"{name} {drawn.config}")
            us = measured.on_gpu[drawn.config, KERNELS[STAGE], 0, TIME_METRIC]
            yield Timed(name, drawn.config, us, _with_each_pair(drawn.run))


def _with_each_pair(run: Run) -> NDArray[np.float64]:
    """Microseconds of the raster in a frame that follows another one."""
    mix, launches = load_mix("tiled", run.machine.compute_capability), run.launches
    place, work = next((i, w) for i, w in enumerate(run.frame.works) if isinstance(w, Work) and w.kernel == STAGE)
    launch, prices = mix.launch(work, run.machine.sm.warp_size), mix.kernels[STAGE].prices
    moved = traffic([*launches, *launches], run.machine)[len(launches) + place]
    chains = [work.table[:, work.events[e]] * prices[e]["chain_alu"] for e in ("ENTRIES", "LONGEST_HITS")]
    found = []
    for pair in PAIRS:
        events = launch.events.copy()
        events[:, MachineEvent.CHAIN_ALU] += sum(
            (TRIED[i] - 1.0) * chain for i, chain in zip(pair, chains, strict=True)
        )
        found.append(1e3 * price([replace(launch, events=events)], run.machine, moved=[moved])[0].milliseconds)
    return np.array(found)
