"""Micro-benchmarks on the GPU at hand: each gives a number of a machine file, its spread, and how it was got."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.validation.gpu import REPEATS, cupy, launch, microseconds, spread

CHAIN = 512  # rounds of four operations
STEPS = 4096  # of a pointer chase
MIB = 1 << 20
ROUNDS = 64  # atomics a thread
CLASSES = ("fp32", "int32", "mul32", "sfu", "control")


@dataclass(frozen=True)
class Number:
    """A measured number of a machine file: ``key`` as ``latency.alu_cycles``."""

    key: str
    value: float | int
    spread: float
    how: str


def measure() -> Iterator[Number]:
    """All numbers, in the order in which they build on each other."""
    clock = _clock()
    yield clock
    sms = int(_attribute("MultiProcessorCount"))
    yield from _device(sms)
    yield from _arithmetic(sms)
    yield from _latencies()
    yield from _memory(sms, clock.value)
    yield from _atomics(sms, clock.value)
    yield from _launches()


def _attribute(name: str) -> int:
    return int(cupy().cuda.Device().attributes[name])


def _device(sms: int) -> Iterator[Number]:
    """What the driver says."""
    shared = _attribute("MaxSharedMemoryPerMultiprocessor")
    for key, value in {
        "sm.count": sms,
        "sm.warp_size": _attribute("WarpSize"),
        "sm.max_threads": _attribute("MaxThreadsPerMultiProcessor"),
        "sm.max_warps": _attribute("MaxThreadsPerMultiProcessor") // _attribute("WarpSize"),
        "sm.max_threads_per_block": _attribute("MaxThreadsPerBlock"),
        "sm.max_blocks": _attribute("MaxBlocksPerMultiprocessor"),
        "sm.registers": _attribute("MaxRegistersPerMultiprocessor"),
        "sm.shared_bytes": shared,
        "sm.reserved_shared_bytes": _attribute("ReservedSharedMemoryPerBlock"),
        "memory.l2_bytes": _attribute("L2CacheSize"),
    }.items():
        yield Number(key, value, 0.0, "driver")


def _cycles(name: str, grid: int, block: int, arguments: Callable[[Any, Any], list[Any]]) -> Any:
    """Cycles of the slowest block, over the repeats."""
    cp = cupy()
    cycles, out = cp.zeros(grid, cp.int64), cp.zeros(grid * block, cp.uint64)
    found = []
    for _ in range(REPEATS):
        launch(name, grid, block, arguments(cycles, out))
        found.append(float(cycles.max()))
    return np.array(found[1:])


def _number(key: str, samples: Any, how: str) -> Number:
    return Number(key, float(np.median(samples)), spread(samples), how)


def _clock() -> Number:
    """Clock of a busy SM: cycles by the SM's own clock over the time of the kernel."""
    cp = cupy()
    grid, n = int(_attribute("MultiProcessorCount")) * 8, 1_000_000
    cycles, out = cp.zeros(grid, cp.int64), cp.zeros(grid * 256, cp.float32)
    times = microseconds(lambda: launch("burn", grid, 256, [n, cycles, out]))
    return _number(
        "sm.clock_mhz", float(cycles.max()) / times, "clock64 of the longest block over event time, SMs busy"
    )


def _arithmetic(sms: int) -> Iterator[Number]:
    """Dependent chains, and eight chains in 32 warps: one class of instruction at a time."""
    pairs = {"control": 2}  # a comparison and a selection
    for name in CLASSES:
        count = CHAIN * 4 * pairs.get(name, 1)
        alone = _cycles(f"lat_{name}", 1, 32, lambda c, o: [CHAIN, c, o]) / count
        full = _cycles(f"thr_{name}", sms, 1024, lambda c, o: [CHAIN, c, o]) / (count * 8 * 32 / 4)
        if name == "fp32":
            yield _number("latency.alu_cycles", alone, "dependent chain of FFMA")
        what = "compare and select" if name == "control" else name
        yield _number(f"pipe.{name}", full, f"32 warps an SM, eight chains a thread, {what}")


def _chase(bytes_: int, stride: int) -> Any:
    """Cycles of a dependent load in a buffer that is walked in a random cycle."""
    cp = cupy()
    count = bytes_ // stride
    order = np.random.default_rng(1).permutation(count).astype(np.int64)
    following = np.empty(count, np.int64)
    following[order] = np.roll(order, -1)
    words = np.zeros(bytes_ // 4, np.uint32)
    words[:: stride // 4] = following * (stride // 4)
    # the kernel adds words to a pointer of words
    buffer = cp.asarray(words)
    return _cycles("chase_global", 1, 1, lambda c, o: [buffer, STEPS, c, o]) / STEPS


def _latencies() -> Iterator[Number]:
    shared = _cycles("chase_shared", 1, 32, lambda c, o: [STEPS, c, o]) / STEPS
    yield _number("latency.shared_cycles", shared, "pointer chase in shared memory")
    near = max(MIB, _attribute("L2CacheSize") // 4)
    yield _number("latency.l2_cycles", _chase(near, 256), f"pointer chase past L1 in {near // MIB} MiB")
    yield _number("latency.dram_cycles", _chase(512 * MIB, 4096), "pointer chase in 512 MiB")
    counter = cupy().zeros(64, cupy().uint32)
    atomic = _cycles("chase_atomic", 1, 1, lambda c, o: [counter, STEPS, c, o]) / STEPS
    yield _number("latency.atomic_cycles", atomic, "chain of atomicAdd, each awaiting the last")
    four = _cycles("barriers", 1, 128, lambda c, _: [STEPS, c]) / STEPS
    many = _cycles("barriers", 1, 1024, lambda c, _: [STEPS, c]) / STEPS
    yield _number("latency.barrier_cycles", four, "__syncthreads of four warps")
    yield _number("issue.barrier", (many - four) / 28, "__syncthreads: cycles a further warp, of 32 against 4")


def _memory(sms: int, mhz: float) -> Iterator[Number]:
    cp = cupy()
    free = int(cp.cuda.runtime.memGetInfo()[0])
    large = min(2048 * MIB, free // 4 // MIB * MIB)
    buffer, out = cp.zeros(large // 4, cp.float32), cp.zeros(1, cp.float32)

    def read(bytes_: int, rounds: int) -> Any:
        times = microseconds(lambda: launch("read_all", sms * 4, 512, [buffer, np.uint64(bytes_ // 16), rounds, out]))
        return bytes_ * rounds / times  # bytes a microsecond: MB/s

    yield _number("memory.dram_gb_per_s", read(large, 1) / 1e3, f"reading {large // MIB} MiB: sustained")
    part = max(MIB, _attribute("L2CacheSize") // 4)
    yield _number(
        "memory.l2_bytes_per_clock", read(part, 64) / mhz, f"reading {part // MIB} MiB again and again, past L1"
    )
    mask = np.uint64(part // 4 - 1) if part & (part - 1) == 0 else np.uint64((1 << (part.bit_length() - 1)) // 4 - 1)
    times = microseconds(lambda: launch("scatter", sms * 8, 256, [buffer, mask, 256]))
    yield _number(
        "memory.l2_write_bytes_per_clock",
        sms * 8 * 256 * 256 * 32 / times / mhz,
        "stores of one word to random sectors",
    )
    l1 = _cycles("read_l1", sms, 256, lambda c, _: [buffer, 512, c, out])
    yield _number("memory.l1_bytes_per_clock", 512 * 4 * 256 * 16 / l1, "hits in L1, 16 bytes a lane")
    for_one = _cycles("banks", sms, 1024, lambda c, o: [1, 512, c, o]) / (512 * 8 * 32)
    yield _number("memory.bank_pass_cycles", for_one, "shared loads without conflict, 32 warps")

    def conflicting(stride: int) -> float:
        return float(np.median(_cycles("banks", sms, 1024, lambda c, o: [stride, 512, c, o])))

    lanes = [conflicting(1), conflicting(32)]
    yield Number(
        "memory.banks", int(2 ** round(np.log2(lanes[-1] / lanes[0]))), 0.0, "slow-down at a stride of 32 words"
    )


def _atomics(sms: int, mhz: float) -> Iterator[Number]:
    cp = cupy()
    counters, grid, block = cp.zeros(16 * MIB, cp.uint32), sms * 8, 256
    out = cp.zeros(grid * block, cp.uint32)

    def rate(kernel: str, *pattern: int, rounds: int = ROUNDS) -> Any:
        arguments = [counters, *map(np.uint32, pattern), rounds, out]
        return grid * block * rounds / microseconds(lambda: launch(kernel, grid, block, arguments))

    everything = 16 * MIB - 1
    one = rate("atomics_blind", 1, 0, 0, everything, 0, rounds=8)
    yield _number("atomics.unit_ns_per_request", 1e3 / one, "all lanes at one address")

    def random(awaited: int) -> Any:
        arguments = [counters, np.uint32(1_000_000), awaited, ROUNDS, out]
        return grid * block * ROUNDS / microseconds(lambda: launch("atomics_random", grid, block, arguments))

    blind, awaited = random(0), random(1)
    yield _number("atomics.requests_per_clock", awaited / mhz, "a million random sectors, value used")
    yield _number("atomics.unawaited_per_clock", blind / mhz, "a million random sectors, no value")
    yield Number(
        "atomics.units",
        max(1, round(float(np.median(blind) / np.median(one)))),
        spread(blind),
        "random over one address",
    )
    words = [
        float(np.median(rate("atomics_blind", 8, s, 0, everything, 0, rounds=8)))
        for s in (8, 16, 32, 64, 128, 256, 512)
    ]
    # eight addresses a spacing apart: once each has a unit of its own, a larger spacing is no faster
    best = max(words)
    first = next(i for i, w in enumerate(words) if w > 0.7 * best)
    yield Number(
        "atomics.unit_bytes", 32 << first, 0.0, "eight addresses: spacing from which they no longer wait for each other"
    )


def _launches() -> Iterator[Number]:
    cp = cupy()
    many = 200
    kernel = lambda: launch("empty", 1, 32, [])  # noqa: E731 - one line

    def row() -> None:
        for _ in range(many):
            kernel()

    yield _number("launch.stream_us", microseconds(row) / many, f"{many} empty kernels in a stream")

    def waited() -> None:
        kernel()
        cp.cuda.Device().synchronize()

    yield _number("launch.sync_us", microseconds(waited), "an empty kernel and a wait")
    stream = cp.cuda.Stream(non_blocking=True)
    with stream:
        stream.begin_capture()
        row()
        graph = stream.end_capture()
        graph.upload(stream) if hasattr(graph, "upload") else None

        def run() -> None:
            graph.launch(stream=stream)

        run()
        stream.synchronize()
        graphs = microseconds(run) / many
    yield _number("launch.graph_us", graphs, f"{many} empty kernels in a graph")
    blocks = 1_000_000
    yield _number(
        "launch.blocks_per_us", blocks / microseconds(lambda: launch("empty", blocks, 32, [])), "a million empty blocks"
    )
