"""What the frontier of the methods compares: pipelines with options, each with a name for the plots."""

from dataclasses import dataclass, field
from typing import Any

FORMATS = ("fixed16", "fixed24", "fixed32", "float32")


@dataclass(frozen=True)
class Variant:
    """A pipeline with options.

    Parameters
    ----------
    pipeline : str
    name : str
        Of the options, in a few words.
    options : dict
    """

    pipeline: str
    name: str
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Pipeline and options."""
        return f"{self.pipeline}, {self.name}" if self.name else self.pipeline


BOTH_SIDES = {"cull_backfaces": False}
HARDWARE = [
    Variant("hardware", f"{bits} bits, {depth}", {"bits": bits, "depth_format": depth, **BOTH_SIDES})
    for bits in (4, 8)
    for depth in FORMATS
]
CUDARASTER = [
    Variant("cudaraster", f"{samples} spp" if samples > 1 else "", {"msaa": samples, **BOTH_SIDES})
    for samples in (1, 2, 4, 8)
]
FREEPIPE = [
    Variant("freepipe", "64-bit words"),
    Variant("freepipe", "64-bit words, early z", {"early": True}),
    Variant("freepipe", "32-bit words", {"packing": "32"}),
]
TILED = [Variant("tiled", f"tile {tile}", {"tile": tile, **BOTH_SIDES}) for tile in (4, 8, 16, 32)]
PER_PRIMITIVE = [
    Variant("per-primitive", "as written", {"race": True, **BOTH_SIDES}),
    Variant("per-primitive", "without its race", {"race": False, **BOTH_SIDES}),
]
BINNED = [
    Variant("binned", "", dict(BOTH_SIDES)),
    Variant("binned", "all fragments", {"fragments_a_pixel": 0, **BOTH_SIDES}),
]
STAMPS = [
    Variant("stamps", f"stamp {stamp}, {spp} spp", {"stamp": stamp, "spp": spp})
    for stamp, spp in ((2, 1), (4, 1), (8, 1), (4, 4), (4, 16))
] + [
    Variant("stamps", f"shaded in quads, {name}, 4 spp", {"stamp": 2, "spp": 4, "merge_entries": entries})
    for name, entries in (("not merged", 0), ("merged", 32))
]
ACROSS = [Variant("across-polygons", f"{spp} spp", {"spp": spp}) for spp in (1, 4, 16)]
BIT_MASK = [
    Variant("bit-mask", f"{mask}, {spp} spp", {"mask": mask, "spp": spp})
    for mask, spp in (("plain", 1), ("facing", 1), ("depth", 1), ("depth", 4))
]
MICROPOLYGON = [
    Variant("micropolygon", f"tile {tile}, bound {bound}, {spp} spp", {"tile": tile, "bound": bound, "spp": spp})
    for tile, bound, spp in (
        (8, 4, 1), (16, 4, 1), (32, 4, 1), (8, 4, 4), (8, 4, 16), (8, 8, 1), (16, 8, 1), (16, 8, 4), (8, 2, 1),
    )
] + [Variant("micropolygon", "bound 4, fixed function", {"bound": 4, "hybrid": True})]  # fmt: skip
ROADS = [  # not taken by the papers (experiments/exploration)
    Variant("micropolygon", "5x5 grids", {"grid": 5, "bound": 16 / 3}),
    Variant("micropolygon", "7x7 grids", {"grid": 7, "bound": 8}),
    Variant("micropolygon", "shared vertices", {"shading": "shared"}),
    Variant("micropolygon", "shading what is visible", {"shading": "visible"}),
    Variant("micropolygon", "masks, tile 4 in 16", {"coarse": 16, "tile": 4}),
    Variant("micropolygon", "16-bit edges, halves", {"edges": "half"}),
    Variant("micropolygon", "16-bit edges, snapped", {"edges": "snapped"}),
    Variant("micropolygon", "bound 8, snapped edges: no cracks", {"bound": 8, "snap_edges": True}),
    Variant("micropolygon", "bound 8, one depth: no cracks", {"bound": 8, "min_depth": 4}),
    Variant("micropolygon", "grids sorted and culled", {"cull": "sorted"}),
    Variant("micropolygon", "buckets, tile 8 in 32", {"coarse": 32, "second_level": "buckets"}),
]
FILTERED = [
    Variant(pipeline, f"{texture_filter} texels", {"texture_filter": texture_filter, **BOTH_SIDES})
    for pipeline, filters in (
        ("tiled", ("nearest", "bilinear")),
        ("per-primitive", ("nearest", "bilinear")),
        ("binned", ("nearest", "bilinear", "trilinear")),
    )
    for texture_filter in filters
] + [Variant("binned", "trilinear texels, no quads", {"derivatives": "planes", **BOTH_SIDES})]

# Kernels of these are compiled by other experiments of the first run; the others would add minutes of compiling
QUICK_TRIANGLES = [HARDWARE[2], *HARDWARE[4:], CUDARASTER[0], *FREEPIPE, *TILED[1:3]]
QUICK_PATCHES = MICROPOLYGON
ALL_TRIANGLES = [
    *HARDWARE, *CUDARASTER, *FREEPIPE, *TILED, *PER_PRIMITIVE, *BINNED, *STAMPS, *ACROSS, *BIT_MASK,
]  # fmt: skip
ALL_PATCHES = [*MICROPOLYGON, *ROADS, *STAMPS, *ACROSS, *BIT_MASK]
