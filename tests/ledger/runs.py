"""What the ledger's frames did and cost: every number of each kernel, and whether all events and prices occur."""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from tests.ledger.frames import Frame, frames
from tilestamp import Run, TilestampError
from tilestamp.models.events import MachineEvent
from tilestamp.simulator.mix import MIXES, Mix, load_mix
from tilestamp.simulator.work import Work

CHAIN = tuple(event for event in MachineEvent if event.name.startswith("CHAIN"))


@cache
def runs(pipeline: str) -> tuple[tuple[Frame, Run | TilestampError], ...]:
    """Each frame of a pipeline with its run, or with the error that says why the machine cannot run it."""
    return tuple((frame, _run(frame)) for frame in frames(pipeline))


def _run(frame: Frame) -> Run | TilestampError:
    try:
        return frame.run()
    except TilestampError as error:
        return error


def _works(pipeline: str) -> Iterator[Work]:
    """Works of all frames of a pipeline."""
    for _, run in runs(pipeline):
        if isinstance(run, Run):
            yield from (work for work in run.frame.works if isinstance(work, Work))


def event_kinds(pipeline: str) -> set[str]:
    """Enums of the events that a pipeline's stages count, by name."""
    return {work.events.__name__ for work in _works(pipeline)}


def silent_events(pipeline: str) -> set[str]:
    """Events that are zero in all frames of a pipeline, in their stage and in all that count by the same enum."""
    totals: dict[str, int] = {}
    for work in _works(pipeline):
        for name, count in work.counts().items():
            for kind in (f"{work.stage}.{name}", f"{work.events.__name__} {name}"):
                totals[kind] = totals.get(kind, 0) + count
    return {
        f"{work.stage}.{name}"
        for work in _works(pipeline)
        for name in work.counts()
        if not totals[f"{work.stage}.{name}"] and not totals[f"{work.events.__name__} {name}"]
    }


def entries(pipeline: str) -> dict[tuple[str, str, str], str]:
    """Every number of a pipeline's frames: (frame, kernel, quantity) -> value as text."""
    return {
        (frame.label, kernel, quantity): value
        for frame, run in runs(pipeline)
        for kernel, quantity, value in _frame_entries(run)
    }


def _frame_entries(run: Run | TilestampError) -> Iterator[tuple[str, str, str]]:
    """Numbers of one frame; where the machine cannot run the pipeline, the sentence that says why."""
    if isinstance(run, TilestampError):
        yield "frame", "refused", str(run)
        return
    try:
        yield from _run_entries(run)
    except TilestampError as error:  # no mix for the machine
        yield "frame", "refused", str(error)


def _run_entries(run: Run) -> Iterator[tuple[str, str, str]]:
    """Numbers of each kernel, its launches together, and of the frame."""
    kernels: dict[str, dict[str, Any]] = {}
    for work, launch, timing in zip(run.frame.works, run.launches, run.timings, strict=True):
        total = kernels.setdefault(work.kernel, {})
        for quantity, value in {**_counts(work), **_launch(launch), **_streams(launch), **_times(timing)}.items():
            total[quantity] = _joined(quantity, total[quantity], value) if quantity in total else value
    for kernel, total in kernels.items():
        for quantity, value in total.items():
            if value:
                yield kernel, quantity, value if isinstance(value, str) else f"{value:.12g}"
    yield "frame", "time ms", f"{run.milliseconds:.9g}"
    yield "frame", "time ms by bounds", f"{run.on(run.machine, 'bounds').milliseconds:.9g}"


def _joined(quantity: str, a: Any, b: Any) -> Any:
    """Two launches as one: the larger of what is a maximum, a digest of digests, the sum of all else."""
    if isinstance(a, str):
        return a if a == b else hashlib.sha256((a + b).encode()).hexdigest()[:12]
    return max(a, b) if quantity.startswith("launch") or quantity.endswith("most") else a + b


def _counts(work: Any) -> dict[str, Any]:
    """What the stage counted; and a digest of the table, for who did how much of it."""
    counts: dict[str, Any] = {f"count {name}": count for name, count in work.counts().items()}
    if hasattr(work, "table"):
        counts["count by unit"] = hashlib.sha256(np.ascontiguousarray(work.table).tobytes()).hexdigest()[:12]
    return counts


def _launch(launch: Any) -> dict[str, Any]:
    """The launch's shape, and what the mix made of the counts."""
    if not hasattr(launch, "events"):
        return {}
    events = launch.events.sum(axis=0)
    shape = {name: getattr(launch, name) for name in ("grid", "block", "registers", "shared_bytes", "dispatch")}
    made = {f"machine {event.name}": float(events[event]) for event in MachineEvent}
    most = {f"machine {event.name} most": float(launch.events[:, event].max(initial=0)) for event in CHAIN}
    requests = launch.atomic_requests
    fullest = {} if requests is None else {"machine fullest chunk": int(requests.max(initial=0))}
    return {**{f"launch {name}": value for name, value in shape.items()}, **made, **most, **fullest}


def _streams(launch: Any) -> dict[str, Any]:
    sizes = {}
    for stream in launch.streams:
        for size in ("bytes", "footprint_bytes", "span_bytes", "requested_bytes"):
            sizes[f"stream {stream.buffer} {stream.op} {size}"] = getattr(stream, size, 0)
    return sizes


def _times(timing: Any) -> dict[str, Any]:
    terms = {f"time {name} cycles": cycles for name, cycles in timing.term_cycles.items()}
    bytes_ = {"time dram bytes": timing.dram_bytes, "time l2 bytes": timing.l2_bytes}
    return {**terms, **bytes_, "time ms": timing.milliseconds, "launch occupancy": timing.occupancy}


UNREACHED = {  # prices that no frame of a pipeline pays: why
    "address_calculation: 2x2 slots aggregated": "only ``validate`` runs this variant",
    "pixelShader": "of ``simulator.nvdiffrast.rasterize(cost=)``, which is no pipeline",
}


def unpaid(pipeline: str) -> list[str]:
    """Prices of a pipeline's mixes that no frame of the ledger pays, as ``mix kernel event``."""
    paid: set[tuple[str, str, str]] = set()
    for _, run in runs(pipeline):
        if isinstance(run, Run) and (MIXES / pipeline).is_dir():
            paid |= set(_paid(load_mix(pipeline, run.machine.compute_capability), run))
    prices = {
        (mix.name, kernel, event)
        for path in (MIXES / pipeline).glob("cc*.toml")
        for mix in [load_mix(pipeline, path.stem.removeprefix("cc"))]
        for kernel, priced in mix.kernels.items()
        for event, price in priced.prices.items()
        if kernel not in UNREACHED
        if price is not _of_all_variants(mix, kernel, event) or kernel == kernel.split(": ")[0]
    }
    return sorted(" ".join(price) for price in prices - paid)


def _of_all_variants(mix: Mix, kernel: str, event: str) -> Mapping[str, Any] | None:
    """The price that a variant takes from its kernel's own table, by ``like``."""
    own = mix.kernels.get(kernel.split(": ", maxsplit=1)[0])
    return None if own is None else own.prices.get(event)


def _paid(mix: Mix, run: Run) -> Iterator[tuple[str, str, str]]:
    for work in run.frame.works:
        if isinstance(work, Work):
            variant = f"{work.kernel}: {work.variant}"
            kernel = variant if variant in mix.kernels else work.kernel
            for event, count in work.counts().items():
                if count:
                    yield mix.name, kernel, event
                    if kernel in mix.kernels and mix.kernels[kernel].prices.get(event) is _of_all_variants(
                        mix, kernel, event
                    ):
                        yield mix.name, work.kernel, event
