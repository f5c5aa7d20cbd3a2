"""All micro-benchmarks of ``tilestamp measure-machine``, in the order in which they build on each other."""

from collections.abc import Iterator

from tilestamp.experiments.validation.gpu import cupy
from tilestamp.experiments.validation.measuring import Number, arithmetic, attribute, clock, device, latencies
from tilestamp.experiments.validation.measuring_l2 import l2
from tilestamp.experiments.validation.measuring_memory import atomics, bandwidths, launches
from tilestamp.experiments.validation.measuring_sm import one_sm
from tilestamp.models.errors import TilestampError

NEEDED_BYTES = 3 << 30


def measure() -> Iterator[Number]:
    """Measure the GPU at hand.

    Raises
    ------
    TilestampError
        No CuPy, no GPU, or too little free memory for buffers that no cache holds.
    """
    free = int(cupy().cuda.runtime.memGetInfo()[0])
    if free < NEEDED_BYTES:
        raise TilestampError(f"the GPU has {free >> 20} MiB free and this needs {NEEDED_BYTES >> 20}: is it in use?")
    frequency = clock()
    yield frequency
    sms, dram = attribute("MultiProcessorCount"), 0.0
    yield from device(sms)
    yield from arithmetic(sms)
    yield from latencies()
    for found in bandwidths(sms, frequency.value):
        dram = found.value if found.key == "memory.dram_gb_per_s" else dram
        yield found
    yield from l2(sms, dram, frequency.value)
    yield from atomics(sms, frequency.value)
    yield from one_sm(sms)
    yield from launches()
