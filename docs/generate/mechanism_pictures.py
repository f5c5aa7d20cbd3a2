"""One picture a mechanism, each computed by the machine model from launches made for it."""

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pandas as pd

from tilestamp import Machine, altered, load_machine, simulate
from tilestamp.models.atomic_units import dealing_of, fullest_unit_ns
from tilestamp.models.banks import bank_passes
from tilestamp.models.coalescing import transactions
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch, Stream
from tilestamp.models.occupancy import residency
from tilestamp.models.price import price
from tilestamp.models.spans import spans
from tilestamp.models.traffic import traffic
from tilestamp.reports.plots import lines
from tilestamp.reports.timeline_plot import timeline_plot

MIB = 1 << 20


def pages() -> dict[str, str | bytes]:
    """All pictures, ``time/NAME.png``."""
    return {f"time/{name}.png": _png(draw) for name, draw in PICTURES.items()}


def _png(draw: Callable[[], Any]) -> bytes:
    from matplotlib import pyplot as plt

    axes, data = draw(), BytesIO()
    axes.figure.savefig(data, format="png", dpi=110)
    plt.close(axes.figure)
    return data.getvalue()


def _launch(units: int = 1320, block: int = 128, registers: int = 32, *, buffers: Any = (), **events: Any) -> Launch:
    """Blocks with some events each: one number for all, or one each."""
    table = np.zeros((units, EVENTS))
    for name, count in events.items():
        table[:, MachineEvent[name]] = count
    return Launch(
        stage="example", kernel="example", grid=units, block=block, registers=registers, shared_bytes=0, events=table,
        streams=tuple(buffers),
    )  # fmt: skip


def _lines(rows: list[tuple[str, float, float]], title: str, x: str, y: str, **scales: bool) -> Any:
    table = pd.DataFrame(rows, columns=["which", "x", "y"])
    return lines(table, None, x="x", y="y", by="which", title=title, x_label=x, y_label=y, **scales)


def issue() -> Any:
    """The same number of instructions of four classes."""
    h200, rows = load_machine("h200"), []
    classes = {"FP32": "fp32", "INT32": "int32", "SFU": "sfu", "SHARED": "shared"}
    for event, name in classes.items():
        for count in (0, 500, 1000, 2000, 4000, 8000):
            launch = _launch(2640, **{event: count, "LANES": 32 * count, "CHAIN_ALU": count / 16})
            rows.append((name, count, price([launch], h200)[0].milliseconds * 1e3))
    title = "H200: 2640 blocks of 4 warps, by class of instruction"
    return _lines(rows, title, "warp instructions of a block", "microseconds")


def bandwidth() -> Any:
    """A launch that reads a buffer which an earlier launch wrote, or which nothing did."""
    h200, rows = load_machine("h200"), []
    for which in ("written just before", "from DRAM"):
        for size in (0.125, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 64, 128):
            moved = int(size * MIB)
            events = {"LOAD": moved / 128 / 1320, "LOAD_BYTES": moved / 1320, "LOAD_TRANSACTIONS": moved / 32 / 1320}
            read = _launch(**events, CHAIN_LOAD=4, buffers=[Stream("buffer", "load", moved, moved)])
            wrote = _launch(buffers=[Stream("buffer", "store", moved, moved, partial_lines=0)])
            before = [wrote] if which == "written just before" else []
            rows.append((which, size, price([*before, read], h200)[-1].milliseconds * 1e3))
    title = "H200: time of a launch that reads a buffer"
    return _lines(rows, title, "size of the buffer [MiB]", "microseconds", log_x=True, log_y=True)


def latency() -> Any:
    """The same arithmetic with a longer chain of loads, by how many warps an SM holds."""
    h200, rows = load_machine("h200"), []
    for registers in (255, 128, 80, 64, 48, 40, 32):
        for loads in (0, 8, 32):
            launch = _launch(registers=registers, FP32=4000, LANES=128000, CHAIN_ALU=1000, CHAIN_LOAD=loads)
            held = residency(h200, launch.block, registers, 0)
            rows.append((f"{loads} loads, one after another", held.warps, price([launch], h200)[0].milliseconds * 1e3))
    title = "H200: 1320 blocks of 4 warps. More resident warps hide the wait"
    return _lines(rows, title, "warps that an SM holds", "microseconds", log_y=True)


def coalescing() -> Any:
    """Transactions of a load of 4 bytes a lane, by the distance of the lanes."""
    rows = []
    for name in ("gtx280", "gtx480", "h200"):
        rule = load_machine(name).simt.coalescing
        for stride in (1, 2, 4, 8, 16, 32):
            found = transactions(np.arange(32, dtype=np.int64) * 4 * stride, 32, 4, rule)
            rows.append((name, stride, found[1] / 128))
    title = "Bytes moved for each byte asked for: 32 lanes load 4 bytes each"
    return _lines(rows, title, "words from lane to lane", "bytes moved / bytes asked", log_x=True)


def banks() -> Any:
    """Passes of a shared load, by the distance of the lanes."""
    rows = []
    for name in ("gtx280", "gtx680", "h200"):
        simt = load_machine(name).simt
        for stride in range(1, 34):
            words = np.arange(32, dtype=np.int64) * stride
            rows.append((name, stride, bank_passes(words, 32, simt)))
    return _lines(rows, "Passes of one shared load of a warp", "words from lane to lane", "passes")


def cache() -> Any:
    """Bytes from DRAM when a buffer that was just written is read."""
    rows = []
    for name in ("gtx480", "a100", "h200"):
        for size in (0.25, 0.5, 1, 2, 4, 8, 16, 24, 32, 40, 48, 64, 96, 128):
            moved = int(size * MIB)
            parts = [_launch(buffers=[Stream("buffer", op, moved, moved, partial_lines=0)]) for op in ("store", "load")]
            found = traffic(parts, load_machine(name))
            rows.append((name, size, found[1].dram_bytes / moved))
    title = "What a launch reads of a buffer that the launch before wrote"
    return _lines(rows, title, "size of the buffer [MiB]", "DRAM bytes / bytes of the buffer", log_x=True)


def atomics() -> Any:
    """A million atomic requests, by how many counters they are spread over."""
    rows = []
    for name in ("gtx280", "gtx480", "h200"):
        dealing = dealing_of(load_machine(name))
        for counters in (1, 4, 16, 64, 256, 1024, 4096, 16384):
            chunks = np.bincount(np.arange(counters) * 4 // 32, minlength=1) * (1_000_000 // counters)
            rows.append((name, counters, fullest_unit_ns(chunks.astype(np.int64), dealing) * 1e-6))
    title = "A million atomics: time of the unit that owns the most of their addresses"
    return _lines(rows, title, "counters of 4 bytes, side by side", "milliseconds", log_x=True, log_y=True)


def start() -> Any:
    """Blocks that do nothing, and blocks that work."""
    rows = []
    for name in ("gtx280", "h200"):
        machine = load_machine(name)
        for blocks in (10, 30, 100, 300, 1000, 3000, 10000, 30000):
            for work in (0, 20_000):
                launch = _launch(blocks, FP32=work, LANES=32 * work, CHAIN_ALU=work // 4)
                which = f"{name}, {f'{work} instructions each' if work else 'empty'}"
                rows.append((which, blocks, price([launch], machine)[0].milliseconds * 1e3))
    return _lines(rows, "Starting blocks takes time", "blocks", "microseconds", log_x=True, log_y=True)


def balance() -> Any:
    """SMs over time, for a launch with one block that is 20 times as long as the others."""
    machine = load_machine("gtx480")
    work = np.random.default_rng(1).uniform(500, 1500, 120)
    work[100] = 20_000
    launch = _launch(120, 256, 40, FP32=work, LANES=32 * work, CHAIN_ALU=work / 4)
    return _timeline(launch, machine, "GTX 480: 120 blocks, and the 101st is 20 times as long: the tail")


def _timeline(launch: Launch, machine: Machine, title: str) -> Any:
    found = spans(launch, machine, traffic([launch], machine)[0])
    edges = np.linspace(0.0, found.total, 600)
    shown = np.zeros((found.sms, len(edges) - 1))
    for begin, end, place in zip(found.start, found.end, found.place, strict=True):
        overlap = np.minimum(edges[1:], end) - np.maximum(edges[:-1], begin)
        shown[place % found.sms] += np.clip(overlap, 0.0, None) / (edges[1] - edges[0]) / (found.places // found.sms)
    columns = len(edges) - 1
    nothing, kind = edges[1:] > found.units_end, np.zeros(columns, np.int64)
    scale = 1e3 / machine.clock_hz
    return timeline_plot(
        shown, kind, nothing, None, names=["blocks"], title=title, x_label="milliseconds", y_label="SM",
        end=found.total * scale,
    )  # fmt: skip


def occupancy() -> Any:
    """Warps that an SM holds, by the registers of a thread."""
    rows = []
    for name in ("gtx280", "gtx480", "h200"):
        machine = load_machine(name)
        for registers in range(16, min(machine.sm.max_registers_per_thread, 128) + 1, 2):
            rows.append((name, registers, residency(machine, 128, registers, 0).warps))  # noqa: PERF401 - two loops
    return _lines(rows, "Warps that an SM holds: blocks of 128 threads", "registers a thread", "warps")


def smooth() -> Any:
    """A frame over the clock and the number of SMs."""
    run = simulate("teapot", machine="gtx280", width=320, height=240, picture=False)
    rows = [("gtx280", sms, run.on(altered(run.machine, {"sm.count": sms})).milliseconds) for sms in range(10, 61, 2)]
    return _lines(
        rows, "A teapot frame over the number of SMs: a better machine is never slower", "SMs", "milliseconds"
    )


PICTURES: dict[str, Callable[[], Any]] = {
    function.__name__: function
    for function in (issue, bandwidth, latency, coalescing, banks, cache, atomics, start, balance, occupancy, smooth)
}
