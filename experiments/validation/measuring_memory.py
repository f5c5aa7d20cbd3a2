"""Micro-benchmarks of bandwidths, bank conflicts, atomics by address pattern, and launches."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import cupy, in_a_graph, launch, microseconds, module
from tilestamp.experiments.validation.measuring import MIB, Number, attribute, cycles_of, number
from tilestamp.experiments.validation.measuring_l2 import owners

ROUNDS = 64  # atomics a thread
SPACINGS = (32, 64, 128, 256, 512, 1024, 2048, 4096)  # bytes between counters
PLACES = 24  # of a table of counters: the hash of addresses lets some collide
KERNELS = 200
NODES = 8  # of a graph as a frame's is: with many, the launch of the graph would not count


def bandwidths(sms: int, mhz: float) -> Iterator[Number]:
    """DRAM, L2 and L1 by bytes a clock; banks."""
    cp = cupy()
    large = _power_of_two(min(2048 * MIB, int(cp.cuda.runtime.memGetInfo()[0]) // 4))
    buffer, out = cp.zeros(large // 4, cp.float32), cp.zeros(1, cp.float32)

    def read(bytes_: int, laps: int) -> NDArray[np.float64]:
        rounds = bytes_ * laps // (sms * 4 * 512 * 8 * 16)
        work = partial(launch, "read_all", sms * 4, 512, [buffer, np.uint64(bytes_ // 16 - 1), rounds, out])
        return sms * 4 * 512 * 8 * 16 * rounds / microseconds(work)  # MB/s

    part = _power_of_two(max(MIB, attribute("L2CacheSize") // 3))
    yield number("memory.dram_gb_per_s", read(large, 1) / 1e3, f"reading {large // MIB} MiB: sustained")
    how = f"reading {part // MIB} MiB again and again, past L1"
    yield number("memory.l2_bytes_per_clock", read(part, 256) / mhz, how)
    l1 = cycles_of("read_l1", sms, 256, lambda c, _: [buffer, 512, c, out])
    yield number("memory.l1_bytes_per_clock", 512 * 8 * 256 * 16 / l1, "hits in L1, 16 bytes a lane")
    straight, worst = _bank_cycles(sms, 1), _bank_cycles(sms, 32)
    yield number("memory.bank_pass_cycles", straight, "shared loads without conflict, 32 warps")
    banks = int(2 ** round(np.log2(np.median(worst) / np.median(straight))))
    yield Number("memory.banks", banks, 0.0, "slow-down of shared loads at a stride of 32 words")


def _power_of_two(bytes_: int) -> int:
    """The largest that is not above."""
    return 1 << (bytes_.bit_length() - 1)


def _bank_cycles(sms: int, stride: int) -> NDArray[np.float64]:
    """Cycles of a warp's shared load whose lanes are ``stride`` words apart."""
    return cycles_of("banks", sms, 1024, lambda c, o: [stride, 512, c, o]) / (512 * 8 * 32)


def atomics(sms: int, mhz: float) -> Iterator[Number]:
    """Rates of one address, of all, with and without a value; how large an L2 unit is, by padding."""
    cp = cupy()
    counters, grid, block = cp.zeros(16 * MIB, cp.uint32), sms * 8, 256
    out, everything = cp.zeros(grid * block, cp.uint32), np.uint32(16 * MIB - 1)

    def rate(kernel: str, *arguments: Any, rounds: int = ROUNDS, place: int = 0) -> NDArray[np.float64]:
        work = partial(launch, kernel, grid, block, [counters[place:], *arguments, rounds, out])
        return grid * block * rounds / microseconds(work)

    word = np.uint32
    one = rate("atomics_blind", word(1), word(0), word(0), everything, word(0), rounds=8)
    yield number("atomics.unit_ns_per_request", 1e3 / one, "all lanes at one address")
    awaited = rate("atomics_random", word(1_000_000), 1)
    blind = rate("atomics_random", word(1_000_000), 0)
    yield number("atomics.requests_per_clock", awaited / mhz, "a million random sectors, value used")
    yield number("atomics.unawaited_per_clock", blind / mhz, "a million random sectors, no value")
    units = owners()
    yield Number("atomics.units", units, 0.0, "words of 512 bytes each whose additions are in each other's way")
    yield number("atomics.spread_ns_per_request", 1e3 * units / blind, "a million random sectors, no value, by units")

    def spaced(bytes_: int) -> float:
        pattern = (word(8), word(bytes_ // 4), word(0), everything, word(0))
        rates = [rate("atomics_blind", *pattern, rounds=4, place=p * 40_961) for p in range(PLACES)]
        return float(np.median([np.median(r) for r in rates]))

    yield unit_bytes({spacing: spaced(spacing) for spacing in SPACINGS}, float(np.median(one)))


def unit_bytes(rates: dict[int, float], one: float) -> Number:
    """Consecutive bytes that one L2 unit owns, from eight counters at growing spacings.

    Up to a unit's size the eight sit in 8 x spacing / size units, and the rate grows in proportion; the size is where
    a line of slope one through the spacings that still share units meets eight times the rate of one address.

    Parameters
    ----------
    rates : dict of int to float
        Requests a microsecond by spacing in bytes.
    one : float
        The same, all at one address.
    """
    shared = [8 * spacing * one / rate for spacing, rate in rates.items() if 1.5 * one < rate < 5 * one]
    told = ", ".join(f"{spacing} B {rate / one:.1f}" for spacing, rate in rates.items())
    size = 2 ** round(np.log2(np.median(shared))) if shared else min(rates)
    return Number("atomics.unit_bytes", int(size), 0.0, f"8 counters, rate over 1: {told}")


def launches() -> Iterator[Number]:
    """An empty kernel in a stream, in a graph, and awaited; blocks a microsecond."""
    cp = cupy()
    function = module("micro.cu").get_function("empty")
    stream = cp.cuda.get_current_stream()

    def empty() -> None:
        cp.cuda.driver.launchKernel(function.kernel.ptr, 1, 1, 1, 32, 1, 1, 0, stream.ptr, 0, 0)

    def row() -> None:
        for _ in range(KERNELS):
            empty()

    yield number("launch.stream_us", microseconds(row) / KERNELS, f"{KERNELS} empty kernels, launched from Python")
    yield number("launch.sync_us", _waited(empty), "an empty kernel and a wait, launched from Python")
    replay = in_a_graph(lambda: launch("empty", 1, 32, []), NODES)
    yield number(
        "launch.graph_us", microseconds(replay) / NODES, f"{NODES} empty kernels in a graph, its launch included"
    )
    blocks = 1_000_000
    times = microseconds(lambda: launch("empty", blocks, 32, []))
    yield number("launch.blocks_per_us", blocks / times, "a million empty blocks")


def _waited(work: Callable[[], None]) -> NDArray[np.float64]:
    """Wall-clock microseconds of a launch and the wait for it."""
    from time import perf_counter

    wait = cupy().cuda.Device().synchronize
    found = []
    for _ in range(100):
        begin = perf_counter()
        work()
        wait()
        found.append(1e6 * (perf_counter() - begin))
    return np.array(found[10:])
