"""Stored measurements: tidy CSV files, and our prediction of every kernel in them."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.validation.back_end import PADDED, SHUFFLED, back_end, cameras, grids_of
from tilestamp.experiments.validation.quantities import (
    MOVED,
    MOVED_AIM,
    MOVED_LOCAL,
    QUANTITIES,
    TIME,
    TIME_AIM,
    TIME_METRIC,
    WALL,
    WALL_AIM,
    warm,
)
from tilestamp.models.errors import MissingInputError, TilestampError
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.remembered import priced_property
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import traffic
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.stages.laine2011.parameter_copy import COPYING, VARIANT, with_parameter_copy
from tilestamp.simulator.work import Work

if TYPE_CHECKING:
    import pandas as pd

Say = Callable[[str], None]
KEYS = ["scene", "W", "tile", "spp", "kernel"]
MICROPOLYGON, FREEPIPE, CUDARASTER = "micropolygon.csv", "freepipe.csv", "cudaraster.csv"
AS_PUBLISHED = "as_published"  # CudaRaster whose setup and bin raster copy their parameters to local memory
WIDEST = {FREEPIPE: 1024, CUDARASTER: 2048}  # pixels: FreePipe on wider screens takes our counting minutes


@dataclass(frozen=True)
class Execution:
    """One measured kernel as we executed it: what prices make of it is priced once.

    Parameters
    ----------
    file : str
        Where it was measured.
    key : tuple
        Scene, width, tile, samples, kernel.
    work : Work
    pipeline : str
    machine : Machine
    seconds : float
        That executing it took us.
    """

    file: str
    key: tuple[Any, ...]
    work: Work
    pipeline: str
    machine: Machine
    seconds: float

    @priced_property
    def launch(self) -> Launch:
        """The kernel in machine events."""
        mix = load_mix(self.pipeline, self.machine.compute_capability)
        return mix.launch(self.work, self.machine.sm.warp_size)

    @priced_property
    def timing(self) -> Timing:
        """Its time, where its buffers are in the cache."""
        return warm(self.launch, self.machine)


def executions(
    folder: Path,
    machine: Machine,
    say: Say,
    *,
    inputs: Path | None = None,
    widest: int | None = None,
    guard_band: bool = False,
    left_out: list[str] | None = None,
) -> Iterator[Execution]:
    """Execute what a folder of measurements holds.

    Parameters
    ----------
    folder : Path
        With micropolygon.csv and its cameras, freepipe.csv and its inputs, or one of them.
    machine : Machine
    say : callable
        Told what is being done.
    inputs : Path, optional
        Folder with the triangles (``ids``); by default the same.
    widest : int, optional
        Pixels: wider screens are left out.
    guard_band : bool
        Whether the CudaRaster that was measured leaves triangles whole that leave the screen by little.
    left_out : list of str, optional
        Takes a sentence for each scene whose model is not at hand; without it that is an error.
    """
    widths = {name: min(most, widest or most) for name, most in WIDEST.items()}
    works: dict[str, Callable[[], Iterator[tuple[tuple[Any, ...], Work]]]] = {
        MICROPOLYGON: lambda: _micropolygon(folder, machine, say, left_out),
        FREEPIPE: lambda: freepipe_works(folder, machine, say, widths[FREEPIPE], inputs),
        CUDARASTER: lambda: cudaraster_works(folder, machine, say, widths[CUDARASTER], inputs, guard_band=guard_band),
    }
    for file, execute in works.items():
        if (folder / file).is_file():
            begun = time.perf_counter()
            for key, work in execute():
                yield Execution(file, key, work, file.removesuffix(".csv"), machine, time.perf_counter() - begun)
                begun = time.perf_counter()


def compare(folder: Path, executed: Iterable[Execution]) -> "pd.DataFrame":
    """Predict what a folder of measurements holds.

    Parameters
    ----------
    folder : Path
    executed : iterable of Execution
        Of that folder.

    Returns
    -------
    DataFrame
        Columns scene, W, tile, spp, kernel, quantity, ours, measured, error, aim, and of times bound; an error is
        relative, absolute for SIMD efficiency.

    Raises
    ------
    TilestampError
        No such folder, or no measurements in it.
    """
    import pandas as pd

    measured = {name: read(folder / name) for name in (MICROPOLYGON, FREEPIPE, CUDARASTER) if (folder / name).is_file()}
    rows = [row for execution in executed for row in _rows(measured[execution.file], execution)]
    if not rows:
        names = f"{MICROPOLYGON}, {FREEPIPE} or {CUDARASTER}"
        raise TilestampError(f"{folder} holds no measurements that we can predict: no {names} with inputs beside it")
    return pd.DataFrame(rows)


def read(path: Path) -> dict[tuple[Any, ...], float]:
    """Value by scene, width, tile, samples, kernel and metric; times and cold counters only."""
    import pandas as pd

    table = pd.read_csv(path)
    if "metric" not in table:
        table = _tall(table)
    missing = {"scene", "W", "kernel", "source", "metric", "value"} - set(table.columns)
    if missing:
        raise TilestampError(f"{path} lacks the columns {', '.join(sorted(missing))}")
    table = table[table.source.isin(["cupti", "ncu_cold"])]
    if path.name == CUDARASTER:
        copying = (table.variant == AS_PUBLISHED) & table.kernel.isin(COPYING)
        table = table.assign(kernel=table.kernel.where(~copying, table.kernel + f" {VARIANT}"))
        table = table.sort_values("variant", kind="stable")  # of kernels that do not copy, the later rows count
    for column in ("tile", "spp"):
        if column not in table:
            table = table.assign(**{column: 0})
    index = [*KEYS, "metric"]
    return dict(zip(table[index].itertuples(index=False, name=None), table.value.astype(float), strict=True))


def _tall(table: "pd.DataFrame") -> "pd.DataFrame":
    """A row a metric, where a table has a row a launch and a column a metric."""
    index = [name for name in (*KEYS, "H", "variant") if name in table]
    tall = table.melt(id_vars=index, var_name="metric").dropna(subset="value")
    return tall.assign(source=["cupti" if name == TIME_METRIC else "ncu_cold" for name in tall.metric])


def _micropolygon(
    folder: Path, machine: Machine, say: Say, left_out: list[str] | None
) -> Iterator[tuple[tuple[Any, ...], Work]]:
    """Kernels of every scene that has a camera, in its own order and shuffled."""
    keys = read(folder / MICROPOLYGON)
    measured, padded = {key[0] for key in keys}, {key[0] for key in keys if key[4] in PADDED}
    for name, camera in cameras(folder).items():
        for scene in (name, name + SHUFFLED):
            if scene in measured:
                say(scene)
                try:
                    grids = grids_of(camera, machine.simt, shuffle=scene != name)
                except MissingInputError as missing:
                    if left_out is None:
                        raise
                    left_out.append(f"{scene} is left out: {missing}")
                    continue
                for case in back_end(grids, camera, machine.simt, padded=scene in padded):
                    key = (scene, camera["width"], case.tile, case.spp, case.kernel)
                    yield key, case.work


def freepipe_works(
    folder: Path, machine: Machine, say: Say, widest: int = WIDEST[FREEPIPE], inputs: Path | None = None
) -> Iterator[tuple[tuple[Any, ...], Work]]:
    """Kernels of every scene and size whose input is there, blind and reading first."""
    for scene, source, width, height in _inputs(folder, FREEPIPE, widest, inputs):
        say(f"FreePipe: {scene} {width}x{height}")
        for kernel in ("freepipe", "freepipe_early"):
            works = _draw("freepipe", source, width, height, machine, early=kernel == "freepipe_early")
            yield (scene, width, 0, 0, kernel), works[0]


def cudaraster_works(
    folder: Path,
    machine: Machine,
    say: Say,
    widest: int = WIDEST[CUDARASTER],
    inputs: Path | None = None,
    *,
    guard_band: bool = False,
) -> Iterator[tuple[tuple[Any, ...], Work]]:
    """The four kernels of every scene and size whose input is there."""
    for scene, source, width, height in _inputs(folder, CUDARASTER, widest, inputs):
        say(f"CudaRaster: {scene} {width}x{height}")
        drawn = _draw("cudaraster", source, width, height, machine, release="nvdiffrast", guard_band=guard_band)
        for work in {work.kernel: work for work in drawn}.values():  # measured when its buffers were large enough
            yield (scene, width, 0, 0, work.kernel), work
            if work.kernel in COPYING:
                yield (scene, width, 0, 0, f"{work.kernel} {VARIANT}"), with_parameter_copy(work)


def _draw(pipeline: str, source: Path, width: int, height: int, machine: Machine, **options: Any) -> list[Work]:
    """Works of a mesh in clip space."""
    import numpy as np

    scene, chosen = load_scene(str(source)), pipeline_options(pipeline, options)
    frame = load_pipeline(pipeline)(scene, np.eye(4), width, height, machine.simt, chosen, Executor())
    return [work for work in frame.works if isinstance(work, Work)]


def _inputs(folder: Path, name: str, widest: int, inputs: Path | None) -> Iterator[tuple[str, Path, int, int]]:
    """Scenes, their inputs and sizes, without those that lack an input or are too wide."""
    for scene, width, height in _sizes(folder / name):
        source = (inputs or folder) / "ids" / f"{scene}_input.npz"
        if width <= widest and source.is_file():
            yield scene, source, width, height


def _sizes(path: Path) -> list[tuple[str, int, int]]:
    import pandas as pd

    table = pd.read_csv(path)[["scene", "W", "H"]].drop_duplicates().sort_values(["W", "scene"])
    return [(str(s), int(w), int(h)) for s, w, h in table.itertuples(index=False)]


def _rows(measured: dict[tuple[Any, ...], float], execution: Execution) -> Iterator[dict[str, Any]]:
    """Ours beside measured, wherever something was measured."""
    begun = time.perf_counter()
    key, launch = execution.key, execution.launch
    about = dict(zip(KEYS, key, strict=True))
    for quantity in QUANTITIES:
        parts = [measured[(*key, metric)] for metric in quantity.metrics if (*key, metric) in measured]
        if parts and (sum(parts) or quantity.aim):
            ours, theirs = quantity.ours(launch), sum(parts)
            error = ours - theirs if quantity.absolute else ours / theirs - 1.0 if theirs else float(ours > 0)
            yield about | _entry(quantity.name, ours, theirs, error, quantity.aim)
    cold = traffic([launch], execution.machine)[0]
    for moved in MOVED_LOCAL if key[4].endswith(VARIANT) else MOVED:
        theirs = sum(w * measured.get((*key, metric), 0.0) for metric, w in moved.metrics)
        if (*key, moved.metrics[0][0]) in measured and theirs > 0:
            ours = moved.ours(launch, cold)
            yield about | _entry(moved.name, ours, theirs, ours / theirs - 1.0, MOVED_AIM)
    if (*key, TIME_METRIC) in measured:
        theirs, ours = measured[(*key, TIME_METRIC)], 1e3 * execution.timing.milliseconds
        yield about | {"bound": execution.timing.bound} | _entry(TIME, ours, theirs, ours / theirs - 1.0, TIME_AIM)
    seconds = execution.seconds + time.perf_counter() - begun
    yield about | _entry(WALL, seconds, WALL_AIM, 0.0, None)


def _entry(quantity: str, ours: float, measured: float, error: float, aim: float | None) -> dict[str, Any]:
    return {"quantity": quantity, "ours": ours, "measured": measured, "error": error, "aim": aim}
