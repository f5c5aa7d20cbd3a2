"""Chrome traces: processes, threads, slices and counters as the JSON that Perfetto and ``chrome://tracing`` open."""

import gzip
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LEVEL = 5  # of compression
STEPS = 30_000  # that the resolution of a process divides it into, at least
Numbers = NDArray[np.float64] | NDArray[np.int64]


@dataclass(frozen=True)
class Process:
    """One process of a trace; times in microseconds.

    Parameters
    ----------
    name : str
    parts : sequence of (name, begin, end)
        Slices of the first thread, that say what the process is made of.
    threads : dict of int to str
        Names by number, from 1 on.
    thread, start, stop : ndarray, (slices,)
        Slices; on one thread none begins before the one before it ends.
    label : ndarray, (slices,), int64
        Index into ``labels``: what a slice is called.
    number, amount : ndarray, (slices,), int64
        Which it is (``unit``), and how much it has (``what``).
    counters : dict of str to (times, values)
    """

    name: str
    parts: Sequence[tuple[str, float, float]] = ()
    threads: dict[int, str] = field(default_factory=dict)
    thread: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    start: Numbers = field(default_factory=lambda: np.empty(0))
    stop: Numbers = field(default_factory=lambda: np.empty(0))
    label: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    labels: Sequence[str] = ()
    number: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    amount: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    unit: str = "unit"
    what: str = "amount"
    counters: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]] = field(default_factory=dict)


def write_trace(processes: Sequence[Process], path: Path, most: int) -> int:
    """Write a compressed trace of at most ``most`` slices on threads, if there are no more threads than that.

    Returns
    -------
    int
        Neighbours on a thread that make one slice: 1 where none had to be merged. A merged slice bears the label of
        its longest part, the number of its first, and the sum of amounts.
    """
    slices = sum(len(process.start) for process in processes)
    together = -(-slices // most) if slices else 1
    while together < slices and sum(_merged(process, together) for process in processes) > most:
        together += 1
    events = (line for pid, process in enumerate(processes, 1) for line in _process(pid, process, together))
    text = '{"displayTimeUnit":"ns","traceEvents":[\n' + ",\n".join(events) + "\n]}\n"
    path.write_bytes(gzip.compress(text.encode(), LEVEL, mtime=0))
    return together


def _merged(process: Process, together: int) -> int:
    """Slices that are left of a process."""
    counts = np.bincount(process.thread.astype(np.int64)) if len(process.thread) else np.zeros(1, np.int64)
    return int((-(-counts // together)).sum())


def _process(pid: int, process: Process, together: int) -> Iterator[str]:
    yield _named(pid, 0, "process_name", f"{pid} {process.name}")
    yield _named(pid, 0, "thread_name", "launch")
    for tid, name in process.threads.items():
        yield _named(pid, tid, "thread_name", name)
    for name, begin, end in process.parts:
        yield f'{{"ph":"X","pid":{pid},"tid":0,"ts":{begin:.4f},"dur":{end - begin:.4f},"name":"{name}"}}'
    yield from _slices(pid, process, together)
    for name, (times, values) in process.counters.items():
        head = f'{{"ph":"C","pid":{pid},"name":"{name}","ts":'
        yield from (
            f'{head}{time:.4f},"args":{{"":{value:.5g}}}}}'
            for time, value in zip(times.tolist(), values.tolist(), strict=True)
        )


def _named(pid: int, tid: int, kind: str, name: str) -> str:
    return f'{{"ph":"M","pid":{pid},"tid":{tid},"name":"{kind}","args":{{"name":{json.dumps(name)}}}}}'


def _slices(pid: int, process: Process, together: int) -> list[str]:
    """Lines of the slices in the order of their starts, which compresses best."""
    order = np.lexsort((process.start, process.thread))
    if not len(order):
        return []
    thread = process.thread[order]
    rank = np.arange(len(order)) - np.searchsorted(thread, thread)  # among those of its thread
    first = np.flatnonzero(rank % together == 0)
    last = np.append(first[1:], len(order)) - 1
    begins, ends = order[first], order[last]
    spans = process.stop - process.start
    longest = begins if together == 1 else order[_longest(spans[order], first)]
    digits = int(np.clip(np.ceil(np.log10(STEPS / max(float(process.stop.max() - process.start.min()), 1e-4))), 0, 4))
    ticks = np.rint(np.array([process.start[begins], process.stop[ends]]) * 10**digits) / 10**digits
    by_start = np.argsort(process.start[begins], kind="stable")
    columns = [process.thread[begins], ticks[0], ticks[1] - ticks[0], np.array(process.labels)[process.label[longest]]]
    columns += [process.number[begins], np.add.reduceat(process.amount[order], first)]
    columns += [last - first + 1] if together > 1 else []
    merged = ',"units":%d' if together > 1 else ""
    line = f'{{"ph":"X","pid":{pid},"tid":%d,"ts":%.{digits}f,"dur":%.{digits}f,"name":"%s","args":{{'
    line += f'"{process.unit}":%d,"{process.what}":%d{merged}}}}}'
    return [line % row for row in zip(*(column[by_start].tolist() for column in columns), strict=True)]


def _longest(lengths: Numbers, first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index of the longest of each run of slices."""
    runs = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(lengths))))
    order = np.lexsort((lengths, runs))
    found: NDArray[np.int64] = order[np.append(first[1:], len(lengths)) - 1]
    return found
