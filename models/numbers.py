"""Priced numbers: those of a machine that the time of a launch depends on, a float64 column each.

A kernel sees a machine as a row of them, so that many machines are one array. What a machine counts, how many blocks it
holds (``models.occupancy``) and what its caches keep (``models.traffic``) comes beside them, by launch.
"""

from collections.abc import Sequence
from enum import IntEnum
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.machine import Machine


class Number(IntEnum):
    """Columns, in the order in which machines that share most of a launch's price come side by side.

    What units ask of their SM comes first, then what settles when they start, then what only the chip's totals need.
    ``SM_CLOCK_MHZ`` is ``sm.clock_mhz`` of a machine file.
    """

    SM_SCHEDULERS = 0
    SM_WARP_SIZE = 1
    ISSUE_FP32 = 2  # one for each class of instructions, in the order of machine events
    ISSUE_INT32 = 3
    ISSUE_MUL32 = 4
    ISSUE_SFU = 5
    ISSUE_CONTROL = 6
    ISSUE_SHARED = 7
    ISSUE_LOAD = 8
    ISSUE_STORE = 9
    ISSUE_ATOMIC = 10
    ISSUE_SHARED_ATOMIC = 11
    ISSUE_BARRIER = 12
    PIPE_FP32 = 13
    PIPE_INT32 = 14
    PIPE_MUL32 = 15
    PIPE_SFU = 16
    PIPE_CONTROL = 17
    MEMORY_BANK_LANES = 18
    MEMORY_BANK_PASS_CYCLES = 19
    MEMORY_L1_BYTES_PER_CLOCK = 20
    MEMORY_L1_WRITE_BYTES_PER_CLOCK = 21
    MEMORY_L1_LINE_CYCLES = 22
    ATOMICS_SM_REQUESTS_PER_CLOCK = 23
    ATOMICS_SM_UNAWAITED_PER_CLOCK = 24
    LATENCY_ALU_CYCLES = 25
    LATENCY_SHARED_CYCLES = 26
    LATENCY_L1_CYCLES = 27
    LATENCY_L2_CYCLES = 28
    LATENCY_DRAM_CYCLES = 29
    LATENCY_ATOMIC_CYCLES = 30
    LATENCY_BARRIER_CYCLES = 31
    LATENCY_BLOCK_LAUNCH_CYCLES = 32
    MEMORY_L2_BYTES = 33
    ATOMICS_REQUESTS_PER_CLOCK = 34
    ATOMICS_UNAWAITED_PER_CLOCK = 35
    SM_COUNT = 36
    SM_CLOCK_MHZ = 37
    LAUNCH_BLOCKS_PER_US = 38
    MEMORY_LOADED_LATENCY = 39
    ATOMICS_CONFLICT_NS = 40
    ATOMICS_LOCKS_DRAM = 41
    MEMORY_L2_BYTES_PER_CLOCK = 42
    MEMORY_L2_WRITE_BYTES_PER_CLOCK = 43
    MEMORY_L2_READ_LINES_PER_CLOCK = 44
    MEMORY_L2_WRITE_LINES_PER_CLOCK = 45
    MEMORY_DRAM_GB_PER_S = 46
    MEMORY_DRAM_EFFICIENCY = 47
    LAUNCH_KERNEL_US = 48
    MEMORY_L2_GAP_LINES_PER_CLOCK = 49


def key_of(number: Number) -> str:
    """Dotted name of a number in a machine."""
    return number.name.lower().replace("_", ".", 1)


_read = attrgetter(*map(key_of, Number))


def numbers_of(machines: Sequence[Machine]) -> NDArray[np.float64]:
    """Priced numbers of machines, (machines, len(Number)), float64."""
    return np.array([_read(machine) for machine in machines], np.float64).reshape(len(machines), len(Number))
