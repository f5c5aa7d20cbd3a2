"""Machine events: what a launch asks of a SIMT machine, a column each in ``Launch.events``.

A stage counts its own events; a mix prices them in these; a machine prices these in time.
A column of instructions counts *warp* instructions.
"""

from enum import IntEnum

from tilestamp.models.counters import count, shown


@shown(
    count("LOAD_TRANSACTIONS", "segments read from global memory"),
    count("STORE_TRANSACTIONS", "segments written to global memory"),
    count("ATOMIC_LANES", "global atomic operations", "atomics"),
    count("ATOMIC_CONFLICTS", "of them at an address that an earlier lane of the instruction has"),
)
class MachineEvent(IntEnum):
    """Columns of a machine event table."""

    # warp instructions by class: each has its own issue cost in a machine file
    FP32 = 0  # float add, multiply, multiply-add, compare, min, max
    INT32 = 1  # integer add, logic, shift, compare, min, max, moves
    MUL32 = 2  # 32-bit integer multiply(-add); several instructions on compute capability 1.x
    SFU = 3  # reciprocal, square root, sine, and conversions between float and integer
    CONTROL = 4  # branches and predicate logic
    SHARED = 5  # shared memory loads and stores
    LOAD = 6  # global loads
    STORE = 7  # global stores
    ATOMIC = 8  # global atomics
    SHARED_ATOMIC = 9  # shared atomics
    BARRIER = 10  # block-wide barriers, one for each warp that arrives
    # lanes
    LANES = 11  # lane instructions that were active, over all classes above
    # memory
    BANK_REPLAYS = 12  # further passes of a shared access, bank conflicts and shared-atomic conflicts
    LOAD_TRANSACTIONS = 13  # segments read, by the coalescing rule
    STORE_TRANSACTIONS = 14  # segments written
    LOAD_BYTES = 15  # bytes of the segments read
    STORE_BYTES = 16  # bytes of the segments written
    # global atomics
    ATOMIC_LANES = 17  # lane operations
    ATOMIC_REQUESTS = 18  # requests that leave the SM after the machine's merging rule
    ATOMIC_CONFLICTS = 19  # lanes at an address that an earlier lane of the same instruction has
    ATOMIC_DEPTH = 20  # sum over instructions of the largest multiplicity of one address (1 = no conflict)
    # dependent chain of a unit of work: round trips that its critical warp waits for, one after another
    CHAIN_ALU = 21  # dependent arithmetic instructions
    CHAIN_SHARED = 22  # dependent shared memory accesses
    CHAIN_LOAD = 23  # dependent global loads (loads in flight together count once)
    CHAIN_ATOMIC = 24  # dependent global atomics whose return value is awaited
    CHAIN_BARRIER = 25  # barriers on the chain
    ISSUE_STALLS = 26  # cycles that instructions hold their scheduler beyond those of their class


INSTRUCTION_CLASSES = tuple(MachineEvent(i) for i in range(MachineEvent.BARRIER + 1))
EVENTS = len(MachineEvent)
