"""Micro-benchmarks of L2: what it keeps of a buffer that all SMs use, lines moved in part, who owns an address."""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import cupy, in_a_graph, launch, microseconds
from tilestamp.experiments.validation.measuring import MIB, Number, attribute, number
from tilestamp.experiments.validation.measuring_sm import QUAD, ROUNDS, SECTOR, THREADS, sent

BLOCK = 256
PASSES = 4  # of a buffer that is written and read
SHARES = (0.2, 0.3, 0.4, 0.8)  # of L2: three that it keeps for sure, one that it keeps in part
STRETCH = 512  # bytes, of which neighbours are mostly owned by different units
STRETCHES, MOST = 512, 400  # that are looked at; units at most
BOTH = 8  # rounds of additions at two words


def l2(sms: int, dram_gb_per_s: float) -> Iterator[Number]:
    """What L2 keeps, and how fast lines are stored and fetched whole and in part."""
    buffer = cupy().zeros(4 * MIB, cupy().uint32)
    lanes = sms * THREADS * ROUNDS
    whole, single = (
        lanes * QUAD / sent("store_quads", buffer, sms),
        lanes * SECTOR / sent("store_scattered", buffer, sms),
    )
    yield number("memory.l2_write_bytes_per_clock", whole, "stores of whole lines, all SMs")
    yield number("memory.l2_write_lines_per_clock", lines(whole, single), "stores of a word to random sectors, all SMs")
    whole, single = lanes * QUAD / sent("load_quads", buffer, sms), lanes * SECTOR / sent("load_scattered", buffer, sms)
    yield number("memory.l2_read_lines_per_clock", lines(whole, single), "loads of a word of random sectors, all SMs")
    size = attribute("L2CacheSize")
    times = {int(share * size) // MIB * MIB: 0.0 for share in SHARES}
    yield kept({bytes_: _rewritten(bytes_) for bytes_ in times}, size, dram_gb_per_s)


def lines(whole: NDArray[np.float64], single: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines a clock that are moved in part, besides their bytes.

    Parameters
    ----------
    whole, single : ndarray, (repeats,), float64
        Bytes a clock of whole lines, and of sectors of ``SECTOR`` bytes that lie by themselves.
    """
    found: NDArray[np.float64] = 1.0 / np.maximum(SECTOR / single - SECTOR / whole, 1e-6)
    return found


def kept(times: Mapping[int, float], l2_bytes: int, dram_gb_per_s: float) -> Number:
    """Share of L2 that holds a buffer which all SMs write and then read, in order.

    Parameters
    ----------
    times : mapping
        Microseconds of a pass by size in bytes; the largest size is kept in part, the others whole. Of a size S, where
        C are kept, ``2 (S - C)`` are fetched from DRAM: reading pushes out what it has not reached.
    l2_bytes : int
    dram_gb_per_s : float
    """
    *whole, large = sorted(times)
    slope, start = np.polyfit(whole, [times[size] for size in whole], 1)
    missed = max(0.0, times[large] - (start + slope * large)) * dram_gb_per_s * 1e3
    told = ", ".join(f"{size // MIB} MiB {us:.2f} us" for size, us in sorted(times.items()))
    share = min(1.0, (large - missed / 2) / l2_bytes)
    return Number("memory.l2_kept_share", share, 0.0, f"a buffer written and read: {told}")


def _rewritten(size: int) -> float:
    """Microseconds in which a buffer is written and read."""
    cp = cupy()
    buffer, out, count = cp.zeros(size // 4, cp.uint32), cp.zeros(1, cp.uint32), np.uint64(size // 16)
    grid = -(-size // 16 // BLOCK)

    def both() -> None:
        launch("fill", grid, BLOCK, [buffer, count, np.uint32(1)], "l2.cu")
        launch("look", grid, BLOCK, [buffer, count, out], "l2.cu")

    return float(np.median(microseconds(in_a_graph(both, PASSES)))) / PASSES


def owners() -> int:
    """Units that own the stretches of a buffer."""
    cp = cupy()
    words = cp.zeros(STRETCHES * STRETCH // 4, cp.uint32)
    run = partial(launch, source="l2.cu")
    cycles = cp.zeros(1, cp.int32)

    def pair(other: int) -> int:
        for _ in range(2):
            run("pair", 1, THREADS, [words, np.uint32(0), np.uint32(other), BOTH, cycles])
        return int(cycles[0])

    same = pair(0)
    apart = int(np.median([pair(other * STRETCH // 4) for other in range(1, 10)]))
    firsts, units, owner = cp.zeros(MOST, cp.uint32), cp.zeros(1, cp.int32), cp.zeros(STRETCHES, cp.int32)
    step = np.uint32(STRETCH // 4)
    run("owners", 1, THREADS, [words, step, STRETCHES, BOTH, (same + apart) // 2, MOST, firsts, units, owner])
    return int(units[0])
