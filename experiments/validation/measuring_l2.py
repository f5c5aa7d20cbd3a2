"""Micro-benchmarks of L2: what it keeps of a buffer that all SMs use, lines moved in part or with gaps, owners."""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import cupy, in_a_graph, launch, microseconds
from tilestamp.experiments.validation.measuring import MIB, Number, attribute, number
from tilestamp.experiments.validation.measuring_sm import QUAD, ROUNDS, SECTOR, THREADS, sent
from tilestamp.models.launch import LINE_BYTES

BLOCK = 256
PASSES = 4  # of a buffer that is written and read
SHARES = (0.2, 0.3, 0.4, 0.8)  # of L2: three that it keeps for sure, one that it keeps in part
RECORD, STORED = 7, (7, 6)  # words of 8 bytes of a record, and of those that are stored: all, or with a gap
GAP_SHARES = (0.5, 0.2)  # of L2: records stored, more than stay there; what stays, as DRAM counters say of an H200
PUSHED_OUT = 0.65  # of L2: bytes stored after them
FETCHED = 512 * MIB  # of which a word of each sector, or of every other one, is read
STRETCH = 512  # bytes, of which neighbours are mostly owned by different units
STRETCHES, MOST = 512, 400  # that are looked at; units at most
BOTH = 8  # rounds of additions at two words


def l2(sms: int, dram_gb_per_s: float, clock_mhz: float) -> Iterator[Number]:
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
    fetched = fetch_bytes(*(_read_apart(bytes_) for bytes_ in (SECTOR, 2 * SECTOR)))
    yield fetched
    whole_us, gaps_us = (_pushed_out(size, stored) for stored in STORED)
    yield gap_lines(whole_us, gaps_us, size, float(fetched.value) / dram_gb_per_s / 1e3, clock_mhz)


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


def fetch_bytes(each_us: float, other_us: float) -> Number:
    """Bytes that a miss brings in: a pair of sectors, if a word of every other sector takes as long as one of each."""
    told = f"a word of each sector of {FETCHED // MIB} MiB {each_us:.1f} us, of every other {other_us:.1f} us"
    return Number("memory.dram_fetch_bytes", 2 * SECTOR if other_us > 0.75 * each_us else SECTOR, 0.0, told)


def gap_lines(whole_us: float, gaps_us: float, size: int, fetch_us: float, clock_mhz: float) -> Number:
    """Lines stored with gaps that are filled up in a clock, besides the fetch.

    Parameters
    ----------
    whole_us, gaps_us : float
        Microseconds of a store of records, all bytes or less the last word, and of one that pushes them out.
    size : int
        Bytes of L2.
    fetch_us : float
        Microseconds in which DRAM sends what a line lacks.
    clock_mhz : float
    """
    lines_left = GAP_SHARES[1] * size / LINE_BYTES
    each = (gaps_us - whole_us) / lines_left - fetch_us
    rate = 1.0 / (each * clock_mhz) if each > 0.0 else 0.0
    told = f"records stored and pushed out: whole {whole_us:.2f} us, with gaps {gaps_us:.2f} us"
    return Number("memory.l2_gap_lines_per_clock", rate, 0.0, told)


def _read_apart(bytes_: int) -> float:
    """Microseconds in which a word is read of each so many bytes of a buffer that L2 cannot hold."""
    cp = cupy()
    buffer, out, count = cp.zeros(FETCHED // 8, cp.uint64), cp.zeros(1, cp.uint32), FETCHED // bytes_
    read = partial(launch, "look_records", -(-count // BLOCK), BLOCK, [buffer, count, bytes_ // 8, out], "l2.cu")
    return float(np.median(microseconds(read)))


def _pushed_out(size: int, stored: int) -> float:
    """Microseconds in which records are stored, so many words of each, and another buffer after them."""
    cp = cupy()
    count, more = int(GAP_SHARES[0] * size) // (8 * RECORD), int(PUSHED_OUT * size) // 16
    records, other = cp.zeros(count * RECORD, cp.uint64), cp.zeros(more * 4, cp.uint32)

    def both() -> None:
        launch("records", -(-count // BLOCK), BLOCK, [records, count, RECORD, stored, np.uint64(1)], "l2.cu")
        launch("fill", -(-more // BLOCK), BLOCK, [other, np.uint64(more), np.uint32(1)], "l2.cu")

    return float(np.median(microseconds(in_a_graph(both, PASSES)))) / PASSES


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
