"""Micro-benchmarks on the GPU at hand: each gives a number of a machine file, its spread, and how it was got."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import REPEATS, cupy, launch, microseconds, spread

CHAIN = 128  # rounds of UNROLLED operations
UNROLLED = 16
STEPS = 4096  # of a chain of loads
KIB, MIB = 1 << 10, 1 << 20
CLASSES = ("fp32", "int32", "mul32", "sfu")
FAR = 90  # percent of addresses of which some are in the far half of L2: the slowest lane of a warp waits so long


@dataclass(frozen=True)
class Number:
    """A measured number of a machine file: ``key`` as ``latency.alu_cycles``."""

    key: str
    value: float | int
    spread: float
    how: str


def number(key: str, samples: NDArray[np.float64], how: str) -> Number:
    """Median and spread of some samples."""
    return Number(key, float(np.median(samples)), spread(samples), how)


def attribute(name: str) -> int:
    """What the driver says of this device."""
    return int(cupy().cuda.Device().attributes[name])


def cycles_of(name: str, grid: int, block: int, arguments: Callable[[Any, Any], list[Any]]) -> NDArray[np.float64]:
    """Cycles of the slowest block, over the repeats."""
    cp = cupy()
    cycles, out = cp.zeros(grid, cp.int64), cp.zeros(grid * block, cp.uint64)
    found = []
    for _ in range(REPEATS):
        launch(name, grid, block, arguments(cycles, out))
        found.append(float(cycles.max()))
    return np.array(found[1:])


def clock() -> Number:
    """Clock of a busy SM: cycles by the SM's own clock over the time of the kernel."""
    cp = cupy()
    grid, n = attribute("MultiProcessorCount") * 8, 1_000_000
    cycles, out = cp.zeros(grid, cp.int64), cp.zeros(grid * 256, cp.float32)
    times = microseconds(lambda: launch("burn", grid, 256, [n, cycles, out]))
    return number("sm.clock_mhz", float(cycles.max()) / times, "clock64 of the longest block over event time, SMs busy")


def device(sms: int) -> Iterator[Number]:
    """What the driver says."""
    threads, warp = attribute("MaxThreadsPerMultiProcessor"), attribute("WarpSize")
    for key, value in {
        "sm.count": sms,
        "sm.warp_size": warp,
        "sm.max_threads": threads,
        "sm.max_warps": threads // warp,
        "sm.max_threads_per_block": attribute("MaxThreadsPerBlock"),
        "sm.max_blocks": attribute("MaxBlocksPerMultiprocessor"),
        "sm.registers": attribute("MaxRegistersPerMultiprocessor"),
        "sm.registers_per_block": attribute("MaxRegistersPerBlock"),
        "sm.shared_bytes": attribute("MaxSharedMemoryPerMultiprocessor"),
        "sm.shared_bytes_per_block": attribute("MaxSharedMemoryPerBlockOptin"),
        "sm.reserved_shared_bytes": attribute("ReservedSharedMemoryPerBlock"),
        "memory.l2_bytes": attribute("L2CacheSize"),
    }.items():
        yield Number(key, value, 0.0, "driver")


def arithmetic(sms: int) -> Iterator[Number]:
    """Dependent chains, and eight chains in 32 warps: one class of instruction at a time.

    Not ``pipe.control``: what our kernels count there are branches (2 clocks each) and instructions of the uniform path
    (none), in a mixture that no micro-benchmark has.
    """
    count = CHAIN * UNROLLED
    for name in CLASSES:
        full = cycles_of(f"thr_{name}", sms, 1024, lambda c, o: [CHAIN, c, o]) / (count * 8 * 32 / 4)
        if name == "fp32":
            alone = cycles_of(f"lat_{name}", 1, 32, lambda c, o: [CHAIN, c, o]) / count
            yield number("latency.alu_cycles", alone, "dependent chain of FFMA")
        yield number(f"pipe.{name}", full, f"32 warps an SM, eight chains a thread, {name}")


def latencies() -> Iterator[Number]:
    """Chains of loads in each level of the memory, of atomics, and of barriers."""
    l2 = attribute("L2CacheSize")
    shared = cycles_of("chase_shared", 1, 32, lambda c, o: [STEPS, c, o]) / STEPS
    yield number("latency.shared_cycles", shared, "chain of loads in shared memory")
    yield number("latency.l1_cycles", _walk("chase_l1", 16 * KIB, 128), "chain of loads in 16 KiB, through L1")
    near, far = l2 // 4 // MIB * MIB, l2 * 3 // 4 // MIB * MIB
    yield number("latency.l2_cycles", _walk("chase_l2", near, 128), f"chain of loads past L1 in {near // MIB} MiB")
    how = f"chain of loads past L1 in {far // MIB} MiB: near and far parts of L2"
    yield number("latency.l2_far_cycles", _walk("chase_l2", far, 128), how)
    dram = _walk("chase_l2", 1024 * MIB, 4096, warm=False)
    yield number("latency.dram_cycles", dram, "chain of loads in 1024 MiB, each line for the first time")
    yield _atomic()
    four = cycles_of("barriers", 1, 128, lambda c, _: [STEPS, c]) / STEPS
    many = cycles_of("barriers", 1, 1024, lambda c, _: [STEPS, c]) / STEPS
    yield number("latency.barrier_cycles", four, "__syncthreads of four warps")
    yield number("issue.barrier", (many - four) / 28, "__syncthreads: cycles a further warp, of 32 against 4")


def _atomic() -> Number:
    """An awaited atomic of a warp whose lanes are everywhere: it waits for the far half of L2."""
    places, rounds = 256, 64
    counters = cupy().zeros(64 * MIB // 4, cupy().uint32)
    cycles, out = cupy().zeros(places, cupy().int64), cupy().zeros(1, cupy().uint32)
    found = []
    for _ in range(REPEATS):
        launch("chase_atomic", 1, 1, [counters, np.uint32(MIB // 16 + 72), places, rounds, cycles, out])
        found.append(float(np.percentile(cupy().asnumpy(cycles), FAR)) / rounds)
    how = f"chains of awaited atomicAdd at {places} addresses, the slowest tenth"
    return number("latency.atomic_cycles", np.array(found[1:]), how)


def _walk(kernel: str, bytes_: int, stride: int, *, warm: bool = True) -> NDArray[np.float64]:
    """Cycles of a dependent load in a buffer that is walked in a random cycle, every line once before if ``warm``."""
    cp = cupy()
    count = bytes_ // stride
    order = np.random.default_rng(1).permutation(count).astype(np.uint64)
    following = np.empty(count, np.uint64)
    following[order] = np.roll(order, -1)
    buffer = cp.zeros(bytes_ // 8, cp.uint64)
    buffer[:: stride // 8] = cp.asarray(following * np.uint64(stride) + np.uint64(buffer.data.ptr))
    place = cp.full(1, buffer.data.ptr, cp.uint64)
    if warm:
        launch(kernel, 1, 1, [count, place, cp.zeros(1, cp.int64)])
    else:
        cp.zeros(attribute("L2CacheSize") // 4, cp.uint64).fill(1)  # twice the cache: nothing of the buffer stays
    return cycles_of(kernel, 1, 1, lambda c, _: [STEPS, place, c]) / STEPS
