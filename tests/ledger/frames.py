"""Small frames of every pipeline on a machine of every family, and of each option that is priced by itself."""

from typing import Any, NamedTuple

import numpy as np

from tests.drawable import scene_for
from tests.ledger.scenes import GENERATED
from tilestamp import Run, simulate

WIDTH, HEIGHT = 96, 72
FAMILIES = ("gtx280", "gtx480", "gtx680", "ga104", "h200")  # compute capability 1, 2, 3, 8, 9
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
