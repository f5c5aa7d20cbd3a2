"""Micro-benchmarks of one SM alone: how soon a block follows another, and what the SM sends to the chip.

The chip's rates (``measuring_memory``) are reached by all SMs together; one SM has its own limits, which the chip's
divided by the number of SMs are not. ``blocks.cu`` with ``-DMAIN`` is a program that prints both, for 1 to all SMs.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import REPEATS, cupy, module
from tilestamp.experiments.validation.measuring import MIB, Number, attribute, number

LAPS = 20  # blocks on an SM, one after another
THREADS = 1024
ROUNDS = 512
SECTOR, QUAD = 32, 16  # bytes: what a word that lies by itself moves, and what a lane stores of a whole line
SENT = {  # number of a machine file: kernel, what a lane sends, and how
    "memory.l1_write_bytes_per_clock": ("store_quads", 16, "stores of whole lines"),
    "atomics.sm_requests_per_clock": ("atomic_awaited", 1, "random sectors, value used"),
    "atomics.sm_unawaited_per_clock": ("atomic_blind", 1, "random sectors, no value"),
}


def one_sm(sms: int) -> Iterator[Number]:
    """A block's start, and the rates at which an SM sends stores and atomics."""
    yield number("latency.block_launch_cycles", _block_starts(sms), "from the end of a block to the next, one an SM")
    buffer = cupy().zeros(4 * MIB, cupy().uint32)
    for key, (kernel, unit, how) in SENT.items():
        yield number(key, unit * THREADS * ROUNDS / sent(kernel, buffer), f"{how}, one SM alone")
    apart = SECTOR * (sent("store_scattered", buffer) / SECTOR - sent("store_quads", buffer) / QUAD) / THREADS / ROUNDS
    yield number("memory.l1_line_cycles", apart, "stores of a word to random sectors, beyond those of whole lines")


def _block_starts(sms: int) -> NDArray[np.float64]:
    """Mean cycles between blocks, over the repeats."""
    rows = cupy().zeros((sms * LAPS, 4), cupy().int64)
    found = []
    for _ in range(REPEATS):
        _alone("wait_cycles", sms * LAPS, 256, [np.int64(5000), rows])
        found.append(float(between(cupy().asnumpy(rows)).mean()))
    return np.array(found[1:])


def between(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cycles from the end of each block to the start of the next on its SM.

    Parameters
    ----------
    rows : ndarray, (blocks, >= 3), int64
        SM, first clock, last clock; an SM ran one block at a time.
    """
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    same = rows[1:, 0] == rows[:-1, 0]
    gaps: NDArray[np.int64] = (rows[1:, 1] - rows[:-1, 2])[same]
    return gaps


def sent(kernel: str, buffer: Any, sms: int = 1) -> NDArray[np.float64]:
    """Cycles of the slowest block of a sending kernel, one on each of some SMs, over the repeats."""
    cp = cupy()
    cycles, out = cp.zeros(sms, cp.int64), cp.zeros(sms * THREADS, cp.uint32)
    found = []
    for _ in range(REPEATS):
        _alone(kernel, sms, THREADS, [buffer, np.uint32(buffer.size - 1), np.int32(ROUNDS), cycles, out])
        found.append(float(cycles.max()))
    return np.array(found[1:])


def _alone(kernel: str, grid: int, block: int, arguments: list[Any]) -> None:
    """Launch blocks with so much shared memory that no second one fits an SM, and no more: L1 needs the rest.

    An L1 of almost nothing halves the awaited atomics that an SM has under way (0.35 a clock instead of 0.64).
    """
    function = module("blocks.cu").get_function(kernel)
    most = attribute("MaxSharedMemoryPerMultiprocessor") // 2 + 1024
    shared = min(most, attribute("MaxSharedMemoryPerBlockOptin"))
    function.max_dynamic_shared_size_bytes = shared
    function((grid,), (block,), tuple(arguments), shared_mem=shared)
