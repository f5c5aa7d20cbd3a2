"""Tables of the page on the machine model, from measurements that are kept and from runs."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
from texts import table

from tilestamp import Machine, Run, altered, load_machine
from tilestamp.experiments.eisenacher2010 import table1, table2, table3
from tilestamp.experiments.eisenacher2010.frames import frame, overhead_ms, stage_ms, stand_in_warnings
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import FOLDER as EXPERIMENTS
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch, Stream
from tilestamp.models.price import price
from tilestamp.models.traffic import traffic
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent as E
from tilestamp.simulator.work import FixedFunctionWork, Work

MIB = 1 << 20
NOTHING = 1e-9  # of a cost; a machine file has no 0 there
FOUND = (30, 36, 48, 64, 128)  # MiB
STORES = {  # measured case, MiB: lines in part, of each sector
    ("in order, 16 bytes a lane", 16): 0.0,
    ("a word in each sector of a random line", 16): 0.25,
    ("a word in a random sector", 16): 1.0,
}
BLOCKS = (128, 512, 1024)  # threads
WITHOUT = {  # number: without it
    "launch.blocks_per_us": 1e6,
    "atomics.unit_ns_per_request": NOTHING,
    "atomics.conflict_ns": NOTHING,
    "fixed_function.per_clock.primitives": 1.0,
}


@cache
def _measured() -> Mapping[tuple[str, str, int, str], float]:
    rows = pd.read_csv(EXPERIMENTS / "silicon" / "measured" / "l2_sweep.csv")
    return {(row.group, row.case, int(row.mib), row.metric): float(row.value) for row in rows.itertuples()}


def _launch(blocks: int, threads: int, streams: tuple[Stream, ...] = ()) -> Launch:
    events = np.zeros((blocks, EVENTS))
    for stream in streams:
        events[:, MachineEvent.STORE_BYTES] += stream.bytes / blocks * (stream.op == "store")
    return Launch(
        stage="s", kernel="k", grid=blocks, block=threads, registers=16, shared_bytes=0, events=events, streams=streams
    )


def silicon() -> str:
    """What L2 and the launch of blocks do on an H200, measured and by the model."""
    h200 = load_machine("h200")
    rows = [*_found(h200), *_stores(h200), *_starts(h200)]
    return table(["what", "measured on the H200", "model"], rows)


def _found(h200: Machine) -> list[list[str]]:
    rows = []
    for size in FOUND:
        parts = [
            _launch(132, 256, (Stream("buffer", op, size * MIB, size * MIB, partial_lines=0),))
            for op in ("store", "load")
        ]
        missed = _measured().get(("counters", "read after write", size, "dram_read_share"))
        told = "" if missed is None else f"{1 - missed:.2f}"
        found = 1 - traffic(parts, h200)[1].load_miss
        rows.append([f"of {size} MiB just written, found in L2 by reading them in order", told, f"{found:.2f}"])
    return rows


def _stores(h200: Machine) -> list[list[str]]:
    rows = []
    for (case, size), lines in STORES.items():
        sectors = size * MIB // 32
        stream = Stream("buffer", "store", size * MIB, size * MIB, partial_lines=int(lines * sectors))
        (timing,) = price([_launch(13200, 256, (stream,))], h200, "bounds")
        ours = sectors / timing.term_cycles["l2"]
        known = _measured()["stores", case, size, "sectors_per_clock"]
        rows.append([f"sectors stored a clock: {case}", f"{known:.1f}", f"{ours:.1f}"])
    return rows


def _starts(h200: Machine) -> list[list[str]]:
    rows = []
    for threads in BLOCKS:
        (timing,) = price([_launch(10_000, threads)], h200)
        known = _measured()["launch", f"empty 10000x{threads}", 0, "us"]
        ours = 1e3 * timing.milliseconds
        rows.append([f"10,000 empty blocks of {threads} threads, us", f"{known:.1f}", f"{ours:.1f}"])
    return rows


def without_the_fits() -> str:
    """What the paper's tables would be without each fitted number of the GTX 280, beside what they are and say."""
    plain = load_machine("gtx280")
    rows = [["all fitted numbers", *_numbers(plain, _whole)]]
    for key, value in WITHOUT.items():
        name = f"`{key}`: {'none' if value == NOTHING else f'{value:g}'} for {plain.number(key):g}"
        rows.append([name, *_numbers(altered(plain, {key: value}), _whole)])
    rows.append(["instructions of a lane that passes the z-test: none for 61", *_numbers(plain, _without_z_lanes)])
    told = "".join(f"\n*{warning}*\n" for warning in stand_in_warnings("killeroo", "bigguy"))
    lines = [["published", *_published()], *rows]
    return f"{told}\n" + table(_columns(), [map(_text, line) for line in lines])


def _whole(run: Run) -> Run:
    return run


def _without_z_lanes(run: Run) -> Run:
    """The run without what is fitted of the tile raster."""
    works = [
        replace(work, table=np.where(np.arange(len(E)) == E.Z_LANES, 0, work.table)) if _rasters(work) else work
        for work in run.frame.works
    ]
    return replace(run, frame=replace(run.frame, works=works))


def _rasters(work: Work | FixedFunctionWork) -> bool:
    return isinstance(work, Work) and work.events is E


def _columns() -> list[str]:
    tiles = ", ".join(str(int(line.tile_size)) for line in published(table1.__file__, "table1").itertuples())
    return [
        "with", f"Table 1: address calculation at tiles of {tiles}, ms", "Table 3: setup, ms", "sampling, ms",
        "sampling of the hybrid, ms", "Table 2: mean error; worst",
    ]  # fmt: skip


def _published() -> list[object]:
    counts = [line.address_calc_ms for line in published(table1.__file__, "table1").itertuples()]
    return [counts, table3.SETUP_MS, table3.SAMPLING_MS[1], table3.HYBRID_SAMPLING_MS, ""]


def _numbers(machine: Machine, changed: Callable[[Run], Run]) -> list[object]:
    counts = [
        stage_ms(table1.bucketing(frame(tile=int(line.tile_size), fidelity="counts")).on(machine), "bucket_count")
        for line in published(table1.__file__, "table1").itertuples()
    ]
    whole = changed(frame().on(machine))
    setup = table3.setup_ms(whole)
    sampling = stage_ms(whole, "tile_raster") - setup
    hybrid = stage_ms(frame(hybrid=True).on(machine), "hardware")
    errors = [abs(error) for error in _errors(machine, changed)]
    return [counts, setup, sampling, hybrid, f"{np.mean(errors):.1%}; {max(errors):.0%}"]


def _errors(machine: Machine, changed: Callable[[Run], Run]) -> list[float]:
    """Of the times of Table 2."""
    errors = []
    for line in published(table2.__file__, "table2").itertuples():
        for spp, known in ((1, line.ms_1spp), (4, line.ms_4spp)):
            made = frame(line.model, line.width, line.height, spp=spp, bound=line.bounding_box)
            made = changed(made.on(machine))
            errors.append((made.milliseconds + overhead_ms(made)) / known - 1)
    return errors


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


TABLES = {"<!-- L2 and blocks of the H200 -->": silicon, "<!-- without the fits -->": without_the_fits}
