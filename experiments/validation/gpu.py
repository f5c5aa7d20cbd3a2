"""The GPU of this computer, through CuPy (the optional extra ``gpu``): compile, launch, time."""

from collections.abc import Callable, Sequence
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError

REPEATS = 9
BUSY = 0.15  # spread of repeats from which a GPU counts as busy


@cache
def cupy() -> Any:
    """CuPy, with a GPU behind it.

    Raises
    ------
    TilestampError
        No CuPy, or no GPU.
    """
    try:
        import cupy as module
    except ImportError as error:
        raise TilestampError("this needs CuPy: install the extra with pip install 'tilestamp[gpu]'") from error
    try:
        found = module.cuda.runtime.getDeviceCount()
    except Exception as error:  # CuPy raises many kinds where there is no driver
        raise TilestampError("this needs an NVIDIA GPU with its driver; none was found on this computer") from error
    if not found:
        raise TilestampError("this needs an NVIDIA GPU; the driver sees none on this computer")
    return module


@cache
def module(name: str, options: tuple[str, ...] = ()) -> Any:
    """Compile one of our CUDA sources for this GPU."""
    source = resources.files("tilestamp.experiments").joinpath("cuda", name).read_text("utf-8")
    return cupy().RawModule(code=source, options=("-std=c++17", *options))


def launch(name: str, grid: int, block: int, arguments: Sequence[Any], source: str = "micro.cu") -> None:
    """Start a kernel; Python ints become 32-bit integers."""
    plain = [np.int32(a) if isinstance(a, int) else a for a in arguments]
    module(source).get_function(name)((grid,), (block,), tuple(plain))


def microseconds(work: Callable[[], None], repeats: int = REPEATS) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Times of ``work`` by events, after two runs that do not count."""
    cp = cupy()
    times = []
    start, end = cp.cuda.Event(), cp.cuda.Event()
    for repeat in range(repeats + 2):
        start.record()
        work()
        end.record()
        end.synchronize()
        if repeat >= 2:  # two warm up
            times.append(1e3 * cp.cuda.get_elapsed_time(start, end))
    return np.array(times)


def in_a_graph(work: Callable[[], None], copies: int) -> Callable[[], None]:
    """Record ``copies`` of some launches in a CUDA graph; returns what replays it."""
    cp = cupy()
    work()  # compiles, and loads the code
    stream = cp.cuda.Stream(non_blocking=True)
    with stream:
        stream.begin_capture()
        for _ in range(copies):
            work()
        graph = stream.end_capture()
    cp.cuda.Device().synchronize()
    replay: Callable[[], None] = graph.launch
    return replay


def spread(values: NDArray[np.float64]) -> float:
    """Half of what lies between the first and the last decile, as a share of the median."""
    low, middle, high = np.percentile(values, [10, 50, 90])
    return float((high - low) / 2 / middle) if middle else 0.0
