"""Small frames of every pipeline on a machine of every family: all counts, prices, bytes and times of each kernel."""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tests.drawable import scene_for
from tests.ledger.scenes import GENERATED
from tilestamp import Run, TilestampError, simulate
from tilestamp.models.events import MachineEvent
from tilestamp.simulator.mix import MIXES, Mix, load_mix
from tilestamp.simulator.work import Work

WIDTH, HEIGHT = 96, 72
FAMILIES = ("gtx280", "gtx480", "gtx680", "ga104", "h200")  # compute capability 1, 2, 3, 8, 9
CHAIN = tuple(event for event in MachineEvent if event.name.startswith("CHAIN"))
TEXTURED = ("tiled", "per-primitive", "binned")  # these draw a textured mesh too
TEXTURE = np.arange(8 * 8 * 3, dtype=np.uint8).reshape(8, 8, 3)
VARIANTS: dict[str, tuple[tuple[str, dict[str, Any]], ...]] = {
    "micropolygon": (
        ("gtx280", {"tile": 4, "spp": 4}),
        ("gtx280", {"tile": 16, "spp": 16, "box_tests": False}),
        ("gtx280", {"edges": "loaded", "bound": 8}),
        ("gtx280", {"hybrid": True}),
        ("gtx480", {"snap_edges": True, "tile": 32}),
        *(
            ("h200", {"tile": tile, "spp": spp, "box_tests": box})  # each compiled by itself
            for tile in (4, 8, 16, 32)
            for spp in (1, 4, 16)
            for box in (True, False)
        ),
        ("h200", {"edges": "loaded"}),
        ("h200", {"snap_edges": True}),
        ("h200", {"bound_rule": "pixel_extent", "min_depth": 3, "near": 0.1}),
        *(("h200", {"shading": "visible", "tile": tile}) for tile in (4, 8, 16, 32)),  # roads not taken, from here on
        *(("gtx280", {"shading": "visible", "edges": edges, "texture": TEXTURE}) for edges in ("computed", "loaded")),
        ("h200", {"snap_edges": True, "texture": TEXTURE}),
        ("gtx280", {"shading": "shared"}),
        ("h200", {"grid": 5}),
        *(("h200", {"coarse": coarse, "tile": tile}) for coarse in (16, 32) for tile in (4, 8)),
        *((machine, {"coarse": 16, "second_level": "buckets"}) for machine in ("gtx280", "h200")),
        ("gtx280", {"coarse": 16}),
        *(("h200", {"cull": "sorted", "tile": tile}) for tile in (4, 8, 16)),
        *((machine, {"cull": "sorted", "bound": 2.0}) for machine in ("gtx280", "h200")),
        ("h200", {"cull": "behind"}),
        *(("h200", {"edges": edges, "tile": tile}) for edges, tile in (("half", 4), ("fixed", 8))),
        ("gtx280", {"edges": "snapped"}),
        *(
            (machine, {"relief": TEXTURE[..., 0], "relief_height": 0.02, "bound": 8.0})
            for machine in ("gtx280", "h200")
        ),
        ("h200", {"grid": 7, "shading": "shared", "texture": TEXTURE}),
    ),
    "cudaraster": (
        ("gtx480", {"msaa": 4}),
        ("gtx480", {"mode": "blend", "batches": 3}),
        ("gtx480", {"mode": "depth-only", "guard_band": False}),
        ("gtx480", {"mode": "color", "cull_backfaces": False, "first_frame": True}),
        ("h200", {"release": "nvdiffrast"}),
        ("h200", {"release": "nvdiffrast", "copy_parameters": True}),
        *(
            (machine, {"mode": "blend", "blend": blend})
            for machine in ("gtx480", "h200")
            for blend in ("over", "additive", "max", "multiply", "nearest", "k-buffer", "stochastic")
        ),
        *(
            (machine, {"mode": "blend", "lists": lists})
            for machine in ("gtx480", "h200")
            for lists in ("linked", "round", "chunked", "fixed")
        ),
        ("gtx480", {"mode": "blend", "lists": "fixed", "room": 1}),
        *((machine, {"mode": "blend", "blend": "tests.ledger.scenes:BRIGHTEST"}) for machine in ("gtx480", "h200")),
    ),
    "nonlinear": (
        ("h200", {"double": False}),
        ("h200", {"method": "tessellated"}),
        ("h200", {"method": "tessellated", "double": False}),
    ),
    "stochastic": (("h200", {"double": True}), ("h200", {"double": True, "bounds": "whole"})),
    "freepipe": (("h200", {"early": True}),),
    "stamps": (("gtx280", {"stamp": 4, "touch": "polygon", "spp": 4}), ("h200", {"coarse": 16, "triangles": True})),
    "tiled": (
        ("gtx680", {"tile": 16, "capacity": "original"}),
        ("gtx680", {"tile": 32, "ssao": True}),
        ("h200", {"samples": "corners", "ssao": True}),
    ),
    "per-primitive": (
        ("gtx680", {"cull_backfaces": False, "ssao": True}),
        ("h200", {"samples": "corners"}),
    ),
    "binned": (("h200", {"original_faults": True, "texture_layout": "rows", "texture_levels": 4}),),
    "hardware": (("h200", {"guard_band": False}),),
    "splat": (
        *(("h200", {"tile": tile}) for tile in (4, 8, "16x8", 32)),  # each priced by itself
        ("h200", {"bound": "box"}),
        ("h200", {"bound": "ellipse", "tile": 8}),
        ("h200", {"threads": 64}),
        ("h200", {"key": 32}),
        ("h200", {"order": "pixel"}),
        *(("h200", {"mask": True, "tile": tile}) for tile in (4, 8, "16x8", 16, 32)),
        ("h200", {"gradients": "lanes"}),
        ("h200", {"gradients": "reduced"}),
    ),
}


class Frame(NamedTuple):
    """One frame of the ledger."""

    pipeline: str
    scene: str
    machine: str
    options: dict[str, Any]
    size: tuple[int, int] = (WIDTH, HEIGHT)

    @property
    def label(self) -> str:
        """As the ledger names it."""
        size = () if self.size == (WIDTH, HEIGHT) else (f"{self.size[0]}x{self.size[1]}",)
        options = (name if isinstance(value, np.ndarray) else f"{name}={value}" for name, value in self.options.items())
        return " ".join([self.scene, self.machine, *size, *options])

    def run(self) -> Run:
        """Execute and price it."""
        scene, (width, height) = GENERATED.get(self.scene, self.scene), self.size
        return simulate(scene, self.pipeline, self.machine, width=width, height=height, **self.options)


MIXED = ("gtx280", "gtx480", "h200")  # one for each mix of the stamp studies
SOUP, EYE, CROWDS = "textured soup", "patches at the eye", "crowds"
GENERATED_FRAMES = (
    Frame("micropolygon", EYE, "gtx280", {"bound": 16.0, "texture": TEXTURE}),
    Frame("micropolygon", EYE, "h200", {"near": 0.2, "spp": 4}),
    Frame("micropolygon", "teapot", "gtx480", {"tile": 4, "bound": 16.0}, (200, 150)),  # sums of blocks to add
    Frame("micropolygon", "teapot", "gtx280", {"tile": 4, "bound": 16.0}, (200, 150)),
    Frame("micropolygon", "teapot", "h200", {"tile": 4, "bound": 16.0}, (200, 150)),
    Frame("micropolygon", "teapot", "h200", {"tile": 4, "bound": 8.0}),  # 3x3 slots
    Frame("cudaraster", SOUP, "gtx480", {"msaa": 2}),
    Frame("cudaraster", SOUP, "gtx480", {"mode": "blend", "msaa": 4, "guard_band": False}),
    Frame("cudaraster", SOUP, "gtx480", {"mode": "blend", "guard_band": False}),
    Frame("cudaraster", SOUP, "gtx480", {"mode": "depth-only", "msaa": 2, "guard_band": False}),
    Frame("cudaraster", SOUP, "gtx480", {"mode": "depth-only", "guard_band": False}),
    Frame("cudaraster", SOUP, "gtx480", {"mode": "color", "guard_band": False}),
    *(
        Frame("cudaraster", SOUP, machine, {"alpha_test": 0.5, "compact": compact, "guard_band": False})
        for machine in ("gtx480", "h200")
        for compact in (False, True)
    ),
    Frame("cudaraster", SOUP, "h200", {"release": "nvdiffrast", "copy_parameters": True}),
    Frame("cudaraster", CROWDS, "h200", {"release": "nvdiffrast", "copy_parameters": True}, (520, 520)),
    Frame("cudaraster", CROWDS, "gtx480", {"cull_backfaces": False, "guard_band": False}, (300, 200)),
    Frame("cudaraster", CROWDS, "h200", {"release": "nvdiffrast"}, (520, 520)),
    Frame("cudaraster", "cut into six", "gtx480", {"guard_band": False, "first_frame": True}, (24, 24)),
    Frame("freepipe", SOUP, "gtx480", {"early": True}),
    Frame("freepipe", SOUP, "gtx480", {}),
    Frame("freepipe", SOUP, "h200", {"early": True}),
    Frame("freepipe", SOUP, "h200", {"packing": "32", "block": 64}),
    Frame("hardware", SOUP, "gtx480", {}),
    *(Frame("stamps", SOUP, machine, {"coarse": 16, "spp": 4}) for machine in MIXED),
    Frame("stamps", EYE, "h200", {"edge": 4.0}),
    Frame("interval", EYE, "h200", {"edge": 8.0, "shade_cache": 16}),
    Frame("interleaved", EYE, "h200", {"edge": 8.0, "shade_cache": 64, "decoupled": False}),
    *(Frame("stamps", EYE, machine, {"edge": 4.0, "spp": 4, "merge_entries": 32}) for machine in MIXED),
    *(Frame("across-polygons", SOUP, machine, {"packing": "sorted"}) for machine in MIXED),
    Frame("across-polygons", EYE, "h200", {"packing": "repacked", "edge": 4.0, "triangles": True}),
    *(Frame("bit-mask", EYE, machine, {"mask": "depth", "edge": 4.0, "spp": 16}) for machine in MIXED),
    Frame("bit-mask", EYE, "gtx480", {"mask": "facing", "edge": 4.0}),
    Frame("bit-mask", SOUP, "h200", {"group": 16, "lanes": 8}),
    *(
        Frame(pipeline, SOUP, machine, {"texture_filter": texels, "ssao": machine == "h200"})
        for pipeline in ("tiled", "per-primitive")
        for machine in ("gtx680", "h200")
        for texels in ("bilinear", "nearest")
    ),
    Frame("binned", SOUP, "ga104", {"fragment_depth": "stepped"}),
    Frame("splat", "odd splats", "h200", {}),
    Frame("splat", "odd splats", "h200", {"bound": "ellipse", "tile": 8}),
    Frame("splat", "odd splats", "h200", {"bound": "ellipse", "tile": 8, "two_scale": True}),
    Frame("binned", SOUP, "h200", {"order": "oit", "texture_filter": "bilinear", "cull_backfaces": False}),
    Frame("binned", SOUP, "h200", {}),  # magnified textures
    *(Frame("binned", SOUP, machine, {"derivatives": "planes"}) for machine in ("ga104", "h200")),
    Frame("binned", SOUP, "ga104", {"optimized": False, "texture_layout": "rows", "texture_filter": "nearest"}),
    Frame("binned", SOUP, "h200", {"optimized": False, "texture_layout": "rows", "texture_filter": "nearest"}),
)


def frames(pipeline: str) -> list[Frame]:
    """Frames of a pipeline: one on a machine of each family, its variants, and those of generated scenes."""
    scenes = ("teapot", "spot") if pipeline in TEXTURED else (scene_for(pipeline),)
    made = [Frame(pipeline, scene, machine, {}) for scene in scenes for machine in FAMILIES]
    made += [Frame(pipeline, scene_for(pipeline), machine, options) for machine, options in VARIANTS.get(pipeline, ())]
    return made + [frame for frame in GENERATED_FRAMES if frame.pipeline == pipeline]


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
