"""Traffic: what the streams of a frame's launches move through L2 and to DRAM.

Without a cache every byte of every transaction goes to DRAM. With an L2, a launch fetches the part of each buffer's
footprint that no earlier launch of the frame left there; bytes beyond the footprint are read again and miss only by
the share in which all footprints of the launch together (or the span that a stream names) exceed the cache. Stores
stay in the cache until something pushes them out (write-back), and the launch that does so pays (``models.cache``),
more for lines that were stored with gaps (``models.gap_lines``).
A frame's launches hand whole buffers to each other, so buffers and not lines are what is reused.

Where L1 keeps what its SM loaded (compute capability 7.0 on), units that ask for the same segment find it there only
if the other ran on the same SM. With S of them and units dealt at random, a segment that k units ask for comes from L2
``S (1 - (1 - 1/S)^k)`` times: hardly less than k for few, at most S for many.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from tilestamp.models.cache import Cache
from tilestamp.models.events import MachineEvent
from tilestamp.models.gap_lines import GapLines
from tilestamp.models.launch import SECTOR_BYTES, Launch, PipeLaunch, Stream
from tilestamp.models.machine import Machine

L1_HOLDS_LOADS = 7.0  # compute capability from which L1 keeps global loads by default; before, a cache of 48 KB or none


class Traffic(NamedTuple):
    """Bytes of one launch.

    Parameters
    ----------
    dram_bytes, l2_bytes : float
    load_miss : float
        Share of the bytes loaded that came from DRAM: it sets the latency of a load.
    written_bytes : float
        Of ``l2_bytes``: stores.
    read_lines, written_lines : float
        Lines that were moved in part, one for each request.
    from_l1 : float
        Share of the bytes that units ask for that L1 holds.
    gap_lines : float
        Lines stored with gaps, by this launch or an earlier one, that were filled up and written back.
    """

    dram_bytes: float
    l2_bytes: float
    load_miss: float
    written_bytes: float = 0.0
    read_lines: float = 0.0
    written_lines: float = 0.0
    from_l1: float = 0.0
    gap_lines: float = 0.0


def traffic(launches: Sequence[Launch | PipeLaunch], machine: Machine) -> list[Traffic]:
    """Bytes of each launch of a frame, in launch order.

    Parameters
    ----------
    launches : sequence of Launch or PipeLaunch
        All launches of the frame; the cache starts empty. A launch without streams moves the bytes of its events,
        all of them through to DRAM.
    machine : Machine
    """
    caches = caches_of(machine)
    l2, gaps = Cache(caches.l2_bytes, caches.dirty_bytes), GapLines(caches.l2_bytes, caches.gap_bytes)
    return [_launch_traffic(_streams(launch), caches, l2, gaps) for launch in launches]


class Caches(NamedTuple):
    """All of a machine that traffic depends on.

    Parameters
    ----------
    l2_bytes : int
        That L2 keeps of what all SMs use.
    dirty_bytes : int
        That it holds at most of what was written and DRAM does not have yet.
    gap_bytes : int
        The same, in lines that were stored with gaps.
    fetch_bytes : int
        That a miss brings in.
    l1_sms : int
        SMs whose L1 keeps what they loaded; 0: none does.
    """

    l2_bytes: int
    dirty_bytes: int
    gap_bytes: int
    fetch_bytes: int
    l1_sms: int


def caches_of(machine: Machine) -> Caches:
    """The caches of a machine."""
    keeps = float(machine.compute_capability) >= L1_HOLDS_LOADS
    memory = machine.memory
    shares = memory.l2_kept_share, memory.l2_dirty_share, memory.l2_gap_share
    kept, dirty, gaps = (round(memory.l2_bytes * share) for share in shares)
    return Caches(kept, dirty, gaps, memory.dram_fetch_bytes, machine.sm.count if keeps else 0)


def _past_l1(streams: tuple[Stream, ...], sms: int) -> tuple[Stream, ...]:
    """Streams with the bytes that come from L2, where each of some SMs' L1 holds what that SM asked for before."""
    if not sms:
        return streams
    return tuple(_scaled(stream, _from_l2(stream, sms)) if stream.requested_bytes else stream for stream in streams)


def _scaled(stream: Stream, bytes_: int) -> Stream:
    """The stream with the bytes that no L1 serves, and such lines in proportion."""
    lines = stream.partial_lines
    return replace(stream, bytes=bytes_, partial_lines=lines and lines * bytes_ // stream.requested_bytes)


def _from_l2(stream: Stream, sms: int) -> int:
    """Bytes of a stream that no L1 serves."""
    footprint = min(stream.footprint_bytes, stream.requested_bytes)
    if not footprint:
        return 0
    again = stream.requested_bytes / footprint
    fetched: float = sms * (1.0 - (1.0 - 1.0 / sms) ** again)
    return round(footprint * fetched)


def _streams(launch: Launch | PipeLaunch) -> tuple[Stream, ...]:
    """Return the streams of a launch; where it names none, one for its loads and one for its stores."""
    if launch.streams or not isinstance(launch, Launch):
        return launch.streams
    totals = launch.totals
    loads, stores = int(totals[MachineEvent.LOAD_BYTES]), int(totals[MachineEvent.STORE_BYTES])
    name = f"{launch.stage}.{launch.kernel}"
    return Stream(f"{name} loads", "load", loads, loads), Stream(f"{name} stores", "store", stores, stores)


def _launch_traffic(requested: tuple[Stream, ...], caches: Caches, cache: Cache, gaps: GapLines) -> Traffic:
    streams = _past_l1(requested, caches.l1_sms)
    moved = float(sum(stream.bytes for stream in streams))
    lines = _lines(streams, "load"), _lines(streams, "store")
    if cache.capacity == 0:
        return Traffic(moved, 0.0, 1.0, 0.0, *lines)
    footprints = _footprints(streams, caches.fetch_bytes)
    written = _footprints((stream for stream in streams if stream.op != "load"), caches.fetch_bytes)
    working_set = sum(footprints.values())
    found, dram = cache.run(footprints, written)
    with_gaps = sum(_footprints((stream for stream in streams if stream.gaps), caches.fetch_bytes).values())
    filled = gaps.run(working_set - sum(found.values()), with_gaps)
    dram += filled * caches.fetch_bytes
    loaded = missed = 0.0
    for stream in streams:
        footprint = _footprint(stream, caches.fetch_bytes)
        span = stream.span_bytes or working_set
        reuse = max(0, stream.bytes - footprint) * max(0.0, 1.0 - cache.capacity / span) if span else 0.0  # what misses
        fetched = 0.0 if stream.op == "store" else max(0.0, footprint - found[stream.buffer])
        dram += fetched + reuse
        if stream.op == "load":
            loaded += stream.bytes
            missed += fetched + reuse
    stored = float(sum(stream.bytes for stream in streams if stream.op == "store"))
    from_l1 = _from_l1(streams) if caches.l1_sms else 0.0
    return Traffic(dram, moved, min(1.0, missed / loaded) if loaded else 0.0, stored, *lines, from_l1, filled)


def _from_l1(streams: tuple[Stream, ...]) -> float:
    """Share of the bytes that units ask for that L1 holds."""
    loads = [stream for stream in streams if stream.op == "load"]
    asked = sum(max(stream.bytes, stream.requested_bytes) for stream in loads)
    return 1.0 - sum(stream.bytes for stream in loads) / asked if asked else 0.0


def _lines(streams: tuple[Stream, ...], op: str) -> float:
    """Lines that are moved in part."""
    return sum(stream.lines_in_part for stream in streams if stream.op == op)


def _footprint(stream: Stream, fetch_bytes: int) -> int:
    """Bytes of the segments that it touches, with what a miss brings in besides."""
    pairs = stream.pair_bytes if fetch_bytes > SECTOR_BYTES else 0
    return pairs or min(stream.footprint_bytes, stream.bytes)


def _footprints(streams: Iterable[Stream], fetch_bytes: int) -> dict[str, int]:
    """Footprint by buffer: the largest of its streams."""
    sizes: dict[str, int] = {}
    for stream in streams:
        sizes[stream.buffer] = max(sizes.get(stream.buffer, 0), _footprint(stream, fetch_bytes))
    return sizes
