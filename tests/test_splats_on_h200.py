"""The pipeline splat does what an H200 did: every array to the bit, every event of the blending loop, every sector."""

import csv
import hashlib
import json

import numpy as np
import pytest

from tilestamp import Scene, simulate
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.pinhole import PinholeCamera
from tilestamp.simulator.scenes.splats import make_splats
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent
from tilestamp.simulator.stages.kerbl2023.project import project
from tilestamp.simulator.stages.kerbl2023.tiles import tiles_of

pytestmark = pytest.mark.shared
CASES = [  # scene, screen, tile, rule
    ("garden1", "980x545", 16, "square"),
    ("garden1", "1920x1080", 8, "tight"),
    ("garden1", "1920x1080", "16x8", "square"),
    ("playbot125k", "980x545", 8, "square"),
    ("playbot125k", "980x545", 32, "tight"),
    ("playbot125k", "1920x1080", 4, "square"),
]
ARRAYS = {"radii": "radii", "touched": "tiles", "xy": "positions", "depth": "depths", "conic": "conics"}
ARRAYS |= {"list": "listed", "keys": "keys", "ncontrib": "reached", "finalT": "transmittance"}
E = BlendEvent
EVENTS = {
    "batches": E.BATCHES,
    "entries_fetched": E.ENTRIES,
    "warp_batches_entered": E.WARP_BATCHES,
    "warp_trips": E.TRIPS,
    "warp_trip_lanes_active": E.EVALUATIONS,
    "warp_trips_with_exp": E.EXP_STEPS,
    "warp_trips_with_blend": E.BLEND_STEPS,
    "pixel_evaluations": E.EVALUATIONS,
    "skipped_power": E.SKIPPED_POWER,
    "skipped_alpha": E.SKIPPED_ALPHA,
    "blended": E.BLENDED,
    "stopped_pixels": E.STOPPED,
}
KERNELS = {"project": "preprocess", "blend": "render"}  # that are called otherwise there


class _Case:
    """One configuration: our run of it, and what was measured."""

    def __init__(self, folder, scene, screen, tile, rule):
        self.folder, self.scene, self.screen, self.rule = folder, scene, screen, rule
        self.tile = f"{tile}x{tile}" if isinstance(tile, int) else tile
        self.camera = json.loads((folder / f"{scene}_scene.json").read_text())["cameras"][screen]
        self.splats = inputs(folder, scene)
        self.run = simulate(
            Scene(scene, splats=self.splats),
            "splat",
            "h200",
            width=self.camera["W"],
            height=self.camera["H"],
            camera=self.camera,
            fidelity="counts",
            tile=tile,
            bound="square" if rule == "square" else "ellipse",
        )

    def rows(self, name):
        """Rows of a table that are of this configuration."""
        with (self.folder / f"{self.scene}{name}.csv").open() as file:
            for row in csv.DictReader(file):
                if (row["variant"], f"{row['W']}x{row['H']}", row["tile"]) == (self.rule, self.screen, self.tile):
                    yield row

    def metrics(self, source):
        """Values by kernel and metric."""
        return {(row["kernel"], row["metric"]): float(row["value"]) for row in self.rows("") if row["source"] == source}

    def checksums(self):
        return {row["array"]: row["sha256"] for row in self.rows("_checksums")}


def inputs(folder, scene):
    with np.load(folder / "ids" / f"{scene}_input.npz") as file:
        return make_splats(*(file[name] for name in ("means", "scales", "rotations", "opacities", "colours")))


def checksum(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


@pytest.fixture(scope="module", params=CASES, ids=lambda case: " ".join(map(str, case)))
def case(shared, request):
    return _Case(shared / "silicon/splat", *request.param)


def test_every_array_is_the_h200_s_to_the_bit(case):
    buffers, wanted = case.run.frame.buffers, case.checksums()
    arrays = {name: buffers[ours] for name, ours in ARRAYS.items()}
    arrays["color"] = buffers["colours"].transpose(2, 0, 1)
    table = next(work for work in case.run.frame.works if work.stage == "blend").table
    arrays["per"] = table[:, [E.BATCHES, E.EVALUATIONS, E.BLENDED, E.TRIPS]].astype(np.uint32)
    starts = buffers["starts"]
    ends = np.stack([starts[:-1], starts[1:]], axis=1)
    arrays["ranges"] = np.where(ends[:, :1] == ends[:, 1:], 0, ends).astype(np.uint32)
    assert {name for name, array in arrays.items() if checksum(array) != wanted[name]} == set()


def test_the_picture_is_rounded_as_the_measured_one(case):
    with np.load(case.folder / "ids" / f"{case.scene}_{case.screen}_{case.tile}_{case.rule}.npz") as file:
        if "picture_u8" not in file:
            pytest.skip("no picture was kept of this one")
        assert (case.run.image == file["picture_u8"].transpose(1, 2, 0)).all()


def test_the_covariances_in_space_are_the_h200_s(case):
    space = np.zeros((len(case.splats), 6), np.float32)
    tiles = tiles_of(case.camera["W"], case.camera["H"], 16, 16)
    project(case.splats, PinholeCamera.from_mapping(case.camera).pinhole, tiles, Simt(), counting=False, space=space)
    assert checksum(space) == case.checksums()["cov3d"]


def test_every_event_of_the_blending_loop_is_the_h200_s(case):
    measured, counts = case.metrics("stats"), case.run.counts
    found = {name: counts[f"blend.{event.name}"] for name, event in EVENTS.items()}
    assert found == {name: measured["render", name] for name in EVENTS}


def test_what_is_culled_and_the_trips_of_duplication_are_the_h200_s(case):
    measured, counts = case.metrics("stats"), case.run.counts
    later = counts["project.CULLED_DETERMINANT"] + counts["project.CULLED_SCREEN"]
    assert later == measured["preprocess", "culled_later"]
    assert counts["project.VISIBLE"] == measured["preprocess", "visible"]
    assert counts["project.CULLED_NEAR"] == measured["preprocess", "culled_near"]
    assert counts["duplicate.PAIRS"] == measured["duplicate", "pairs"]
    assert counts["duplicate.TRIPS"] == measured["duplicate", "warp_trips_of_the_tile_loop"]


def test_sectors_are_the_h200_s(case):
    """Within a thousandth; where blocks wait for each other's sums, they read as many as it happens: within 6 %."""
    measured, ratios = case.metrics("ncu_cold"), {}
    for work in case.run.frame.works:
        number = f"_{work.variant[-1]}" if work.kernel == "sort_onesweep" else ""
        kernel = KERNELS.get(work.kernel, work.kernel) + number
        for op, event in (("ld", "LOAD_TRANSACTIONS"), ("st", "STORE_TRANSACTIONS")):
            sectors = measured.get((kernel, f"l1tex__t_sectors_pipe_lsu_mem_global_op_{op}.sum"), 0.0)
            if sectors > 1000:
                ratios[kernel, op] = work.counts()[event] / sectors
    waits = {key for key in ratios if key[0] == "scan" or (key[0].startswith("sort_onesweep") and key[1] == "ld")}
    assert {key: ratio for key, ratio in ratios.items() if abs(ratio - 1) > (0.06 if key in waits else 1.5e-3)} == {}
