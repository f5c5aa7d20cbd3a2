"""PrimitiveCompaction: stream compaction of the primitive buffer in one launch (Zhang 2025, stage 3).

A cooperative launch of one thread a slot, 256 a block, in three phases with grid synchronisation between them: flags
and block scans, a scan of the block sums, the copy. All blocks must be resident at once, so the machine limits the
primitive buffer, which has four slots for each triangle: "currently we cannot process model have more than 10k".
"""

from enum import IntEnum

import numpy as np

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.launch import Stream
from tilestamp.models.machine import Machine
from tilestamp.models.occupancy import residency
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, record_transactions
from tilestamp.simulator.stages.zhang2025.primitive_assembly import PRIMITIVE_BYTES, Primitives
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
REGISTERS = 40  # a thread, from his profile
SLOTS_A_TRIANGLE = 4


class PrimitiveCompactionEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # flag, scan in the block, copy
    KEPT = 1  # lanes that copy their primitive
    GRID_SYNC = 2  # grid synchronisations, one for each block that arrives
    LOAD_TRANSACTIONS = 3
    LOAD_BYTES = 4
    STORE_TRANSACTIONS = 5
    STORE_BYTES = 6
    KEPT_WARPS = 7  # warps that copy a primitive
    BLOCKS = 8
    ATOMIC = 9  # of the grid's barrier, by one thread of each block
    ATOMIC_LANES = 10
    ATOMIC_REQUESTS = 11
    ATOMIC_DEPTH = 12


def primitive_compaction(slots: Primitives, triangles: int, simt: Simt) -> StageResult[Primitives]:
    """Close the gaps of culled primitives.

    Parameters
    ----------
    slots : Primitives
    triangles : int
        Triangles drawn: the launch covers four slots for each.
    simt : Simt

    Returns
    -------
    outputs : Primitives
    works : one
    """
    kept = np.flatnonzero(slots.ids >= 0)
    blocks = max(1, -(-max(len(slots.ids), SLOTS_A_TRIANGLE * triangles) // BLOCK))
    events = np.zeros((blocks, len(PrimitiveCompactionEvent)), np.int64)
    warps = BLOCK // simt.warp
    copies = np.bincount(kept // BLOCK, minlength=blocks)
    copying = np.bincount(np.unique(kept // simt.warp) // warps, minlength=blocks)
    ids = record_transactions(Access("primitives", PRIMITIVE_BYTES, 1), simt)
    segment = smallest_transaction_bytes(int(simt.coalescing))
    words = copies * (PRIMITIVE_BYTES // 4)
    events[:, PrimitiveCompactionEvent.WARPS] = warps
    events[:, PrimitiveCompactionEvent.KEPT] = copies
    events[:, PrimitiveCompactionEvent.KEPT_WARPS] = copying
    events[:, PrimitiveCompactionEvent.BLOCKS] = 1
    events[:, PrimitiveCompactionEvent.GRID_SYNC] = 2
    events[:, PrimitiveCompactionEvent.ATOMIC :] = 2
    events[:, PrimitiveCompactionEvent.LOAD_TRANSACTIONS] = warps * ids[0] + words
    events[:, PrimitiveCompactionEvent.LOAD_BYTES] = warps * ids[1] + words * segment
    events[:, PrimitiveCompactionEvent.STORE_TRANSACTIONS] = words
    events[:, PrimitiveCompactionEvent.STORE_BYTES] = words * segment
    streams = (
        Stream(
            "primitives", "load", 32 * blocks * BLOCK + len(kept) * PRIMITIVE_BYTES, blocks * BLOCK * PRIMITIVE_BYTES
        ),
        Stream("compacted", "store", int(words.sum()) * segment, len(kept) * PRIMITIVE_BYTES),
    )
    stage = "PrimitiveCompaction"
    work = Work(stage, PrimitiveCompactionEvent, events, BLOCK, grid=blocks, streams=streams)
    return StageResult(Primitives(slots.screen[kept], slots.varyings[kept], slots.ids[kept]), (work,))


def most_triangles(machine: Machine) -> int:
    """Triangles that the cooperative launch can take on a machine: resident blocks x 256 threads / 4 slots."""
    resident = residency(machine, BLOCK, REGISTERS, 0).blocks
    return machine.sm.count * resident * BLOCK // SLOTS_A_TRIANGLE
