"""Small frames of every pipeline on a machine of every family: all counts, prices, bytes and times of each kernel."""

import hashlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from tilestamp import Run, TilestampError, simulate
from tilestamp.models.events import MachineEvent

WIDTH, HEIGHT = 96, 72
FAMILIES = ("gtx280", "gtx480", "gtx680", "ga104", "h200")  # compute capability 1, 2, 3, 8, 9
CHAIN = tuple(event for event in MachineEvent if event.name.startswith("CHAIN"))
TEXTURED = ("tiled", "per-primitive", "binned")  # these draw a textured mesh too
VARIANTS: dict[str, tuple[tuple[str, dict[str, Any]], ...]] = {
    "micropolygon": (
        ("gtx280", {"tile": 4, "spp": 4}),
        ("gtx280", {"tile": 16, "spp": 16, "box_tests": False}),
        ("gtx280", {"edges": "loaded", "bound": 8}),
        ("gtx280", {"hybrid": True}),
        ("gtx480", {"snap_edges": True, "tile": 32}),
        ("h200", {"tile": 16, "spp": 4}),
        ("h200", {"tile": 32, "box_tests": False}),
        ("h200", {"bound_rule": "pixel_extent", "min_depth": 3, "near": 0.1}),
    ),
    "cudaraster": (
        ("gtx480", {"msaa": 4}),
        ("gtx480", {"mode": "blend", "batches": 3}),
        ("gtx480", {"mode": "depth-only", "guard_band": False}),
        ("gtx480", {"mode": "color", "cull_backfaces": False, "first_frame": True}),
        ("h200", {"release": "nvdiffrast"}),
        ("h200", {"release": "nvdiffrast", "copy_parameters": True}),
    ),
    "stamps": (("gtx280", {"stamp": 4, "touch": "polygon", "spp": 4}), ("h200", {"coarse": 16, "triangles": True})),
    "tiled": (
        ("gtx680", {"tile": 16, "capacity": "original"}),
        ("gtx680", {"tile": 32, "ssao": True}),
        ("h200", {"samples": "corners", "ssao": True}),
    ),
    "per-primitive": (("gtx680", {"cull_backfaces": False, "ssao": True}), ("h200", {"samples": "corners"})),
    "binned": (("h200", {"original_faults": True, "texture_layout": "rows", "texture_levels": 4}),),
    "hardware": (("h200", {"guard_band": False}),),
}


class Frame(NamedTuple):
    """One frame of the ledger."""

    pipeline: str
    scene: str
    machine: str
    options: dict[str, Any]

    @property
    def label(self) -> str:
        """As the ledger names it."""
        return " ".join([self.scene, self.machine, *(f"{name}={value}" for name, value in self.options.items())])

    def run(self) -> Run:
        """Execute and price it."""
        return simulate(self.scene, self.pipeline, self.machine, width=WIDTH, height=HEIGHT, **self.options)


def frames(pipeline: str) -> list[Frame]:
    """Frames of a pipeline: one on a machine of each family, then its variants."""
    scenes = ("teapot", "spot") if pipeline in TEXTURED else ("teapot",)
    made = [Frame(pipeline, scene, machine, {}) for scene in scenes for machine in FAMILIES]
    return made + [Frame(pipeline, "teapot", machine, options) for machine, options in VARIANTS.get(pipeline, ())]


def entries(pipeline: str) -> dict[tuple[str, str, str], str]:
    """Every number of a pipeline's frames: (frame, kernel, quantity) -> value as text."""
    return {
        (frame.label, kernel, quantity): value
        for frame in frames(pipeline)
        for kernel, quantity, value in _frame_entries(frame)
    }


def _frame_entries(frame: Frame) -> Iterator[tuple[str, str, str]]:
    """Numbers of one frame; where the machine cannot run the pipeline, the sentence that says why."""
    try:
        run = frame.run()
        yield from _run_entries(run)
    except TilestampError as error:
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
        for size in ("bytes", "footprint_bytes", "span_bytes", "asked_bytes"):
            sizes[f"stream {stream.buffer} {stream.op} {size}"] = getattr(stream, size, 0)
    return sizes


def _times(timing: Any) -> dict[str, Any]:
    terms = {f"time {name} cycles": cycles for name, cycles in timing.term_cycles.items()}
    bytes_ = {"time dram bytes": timing.dram_bytes, "time l2 bytes": timing.l2_bytes}
    return {**terms, **bytes_, "time ms": timing.milliseconds, "launch occupancy": timing.occupancy}
