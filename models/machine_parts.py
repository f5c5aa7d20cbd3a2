"""The sections of a machine file, a frozen struct each: units in the names, unknown keys refused.

What scales with what when one number is changed: a number is one SM's (``sm``, ``issue``, ``pipe``, ``latency``, banks,
``l1_*``, ``atomics.sm_*``) or the whole chip's (``dram_*``, ``l2_*``, the rest of ``atomics``, ``launch``). More SMs
bring more of what is an SM's; the chip's stay as they are until they are changed too. Rates a clock and latencies in
cycles follow ``sm.clock_mhz``; ``dram_gb_per_s``, ``*_ns``, ``*_us`` and ``blocks_per_us`` do not.
"""

from typing import Annotated, Literal

import msgspec

MOST_BYTES = 1 << 40
Count = Annotated[int, msgspec.Meta(ge=1, le=1 << 24)]
Size = Annotated[int, msgspec.Meta(ge=0, le=MOST_BYTES)]
Positive = Annotated[float, msgspec.Meta(ge=1e-3, le=1e6)]
Amount = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
Slot = Annotated[float, msgspec.Meta(ge=1 / 64, le=1e4)]  # cycles of an instruction
Ratio = Annotated[float, msgspec.Meta(ge=1, le=1e3)]
Share = Annotated[float, msgspec.Meta(gt=0, le=1)]
Sms = Annotated[int, msgspec.Meta(ge=1, le=1 << 16)]


class Identity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the machine is."""

    name: str
    description: str
    compute_capability: Annotated[str, msgspec.Meta(pattern=r"^\d+\.\d+$")]


class Sm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A multiprocessor: schedulers, and what resident blocks share."""

    count: Sms
    warp_size: Count
    schedulers: Count
    clock_mhz: Positive
    max_warps: Count
    max_threads: Count
    max_blocks: Count
    max_threads_per_block: Count
    registers: Count
    register_unit: Count  # registers are allotted in multiples of this
    register_allocation: Literal["block", "warp"]  # to whom
    warp_granularity: Count  # warps of a block (1.x) or of an SM (later) that get registers come in multiples of this
    max_registers_per_thread: Count
    shared_bytes: Size
    shared_unit_bytes: Count
    reserved_shared_bytes: Size  # that the system takes from every block
    registers_per_block: Size = 0  # that one block may have; 0: all of the SM's
    shared_bytes_per_block: Size = 0  # that one block may ask for; 0: all of the SM's but those reserved
    block_warp_granularity: Size = 0  # to which a block's warps are rounded against registers_per_block; 0: as the SM's


class Issue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cycles for which one warp instruction of ``sm.warp_size`` lanes holds its scheduler, by class."""

    fp32: Slot
    int32: Slot
    mul32: Slot
    sfu: Slot
    control: Slot
    shared: Slot
    load: Slot
    store: Slot
    atomic: Slot
    shared_atomic: Slot
    barrier: Slot


class Pipe(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cycles for which one warp instruction holds the execution unit behind its scheduler; 0: never longer than issue.

    ``sm.warp_size`` over these cycles is lanes a clock: ``machine.altered`` keeps those for another warp size.

    The units work side by side, so the fullest one counts: fp32, int32 with control, mul32, sfu.
    """

    fp32: Amount
    int32: Amount
    mul32: Amount
    sfu: Amount
    control: Amount


class Latency(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cycles that a dependent instruction waits."""

    alu_cycles: Positive
    shared_cycles: Positive
    l2_cycles: Amount  # 0 where there is no L2 for data
    dram_cycles: Positive
    atomic_cycles: Positive
    barrier_cycles: Amount
    block_launch_cycles: Amount  # from a free place on the SM to the first instruction of the block put there
    l1_cycles: Amount = 0.0  # of a load that L1 answers, from compute capability 7.0 on; 0: not known, as l2_cycles
    l2_far_cycles: Amount = 0.0  # described, not priced: data beyond the near part of L2; 0: not known


class Memory(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Widths and sizes of the memory system."""

    coalescing: Literal["half_warp_segments", "warp_lines", "warp_sectors"]
    dram_gb_per_s: Positive
    dram_efficiency: Share  # best sustained share of dram_gb_per_s
    l2_bytes: Size  # 0: no cache between the SMs and DRAM
    l2_line_bytes: Count
    l2_bytes_per_clock: Amount  # all SMs together
    l1_bytes_per_clock: Positive  # global loads and stores of one SM
    banks: Count
    bank_lanes: Count
    bank_pass_cycles: Positive  # one pass of one group of bank_lanes
    bank_bytes: Literal[4, 8] = 4  # that a bank serves a pass
    bank_mode_bytes: Literal[4, 8] = 4  # consecutive words of this size lie in consecutive banks
    l2_kept_share: Share = 1.0  # of l2_bytes, for data that all SMs use: halves keep copies of each other's
    l2_dirty_share: Share = 1.0  # of l2_bytes, at most written and not yet in DRAM
    l2_read_lines_per_clock: Amount = 0.0  # lines fetched in part, which take this besides their bytes; 0: nothing
    l2_write_bytes_per_clock: Amount = 0.0  # as l2_bytes_per_clock, for stores; 0: the same
    l2_write_lines_per_clock: Amount = 0.0  # as l2_read_lines_per_clock, for stores
    l2_gap_lines_per_clock: Amount = 0.0  # stored with gaps and written back, besides their bytes; 0: nothing
    l2_gap_share: Share = 1.0  # of l2_bytes that such lines may take: those beyond are written back at once
    dram_fetch_bytes: Count = 32  # that a miss brings in
    l1_write_bytes_per_clock: Amount = 0.0  # as l1_bytes_per_clock, for stores, which L1 does not gather; 0: the same
    l1_line_cycles: Amount = 0.0  # of one SM, for a line fetched or stored in part, besides its bytes
    loaded_latency: Ratio = 1.0  # times that a block that waited for a place takes longer, while memory is busy


class Atomics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where global atomics are performed, and how fast."""

    place: Literal["dram_lock", "l2_unit"]
    merge: Literal["none", "sector"]
    unit_bytes: Count  # consecutive bytes that one lock or unit owns
    units: Size  # units that the addresses are dealt to; 0: each stretch of unit_bytes has its own
    unit_ns_per_request: Amount  # for which the unit is held, where one address is wanted again and again
    requests_per_clock: Positive  # all units together, at different addresses
    conflict_ns: Amount  # further time of the whole memory system for a lane that an earlier lane of its warp blocks
    spread_ns_per_request: Amount = 0.0  # as unit_ns_per_request, at many addresses of the unit; 0: the same
    unawaited_per_clock: Amount = 0.0  # as requests_per_clock, where no value is returned; 0: the same
    sm_requests_per_clock: Amount = 0.0  # what one SM sends; 0: not known, as much as all units together take
    sm_unawaited_per_clock: Amount = 0.0  # as sm_requests_per_clock, where no value is returned; 0: the same

    @property
    def locks_dram(self) -> bool:
        """Whether an atomic locks DRAM."""
        return self.place == "dram_lock"


class Launching(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a launch costs besides its work."""

    kernel_us: Amount  # of a kernel's own duration
    stream_us: Amount  # from one empty kernel to the next in a stream
    graph_us: Amount  # the same in a graph; stream_us where there are no graphs
    sync_us: Amount  # launch and wait for the result
    blocks_per_us: Positive


class FixedFunction(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The fixed-function pipe: what each unit does in a clock, all copies of it together."""

    clock_mhz: Positive
    per_clock: dict[str, Positive]
