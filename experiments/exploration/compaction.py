"""Compact after discard: warps that shade what an alpha test leaves, before and after survivors are gathered."""

from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.frontier.methods_scenes import grid_triangles
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.machine import load_machine
from tilestamp.reports.picture import picture
from tilestamp.reports.plots import lines
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, Scene, clip_space_scene
from tilestamp.simulator.simulation import simulate

QUESTION = "How full are the warps that shade what an alpha test leaves, and does gathering survivors pay?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
MACHINE = "gtx480"  # the paper's, whose mix has release 1.1 whole
SIDE = 64  # pixels
FEATURES = (2, 16)  # pixels from a corner of the mesh to the next: alpha is at random in each
LAYERS = (1, 4, 16)  # sheets, the farthest first, so that every fragment passes the depth test
SHARES = (0.0, 0.25, 0.5, 0.75, 0.9, 0.97)  # of the fragments that are discarded, about
SHOWN = (4, 0.75)  # layers and share of the plots of the answer
WARP = 32
SURE = (
    "Sure: the counts, each of which plain Python gives as well. Not sure: the prices, which are counted by hand; the"
    " alpha test reads and interpolates what the shader reads and interpolates once more."
)


def foliage(feature: int, layers: int, seed: int = 7) -> Scene:
    """Make sheets over the whole screen with an alpha at random in each corner, one in front of the other."""
    random, n = np.random.default_rng(seed), SIDE // feature + 1
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    one = grid_triangles(n, n)
    positions = np.ones((layers, n * n, 4), np.float32)
    positions[..., 0], positions[..., 1] = x.ravel(), y.ravel()
    positions[..., 2] = np.linspace(0.8, 0.2, layers)[:, None]
    colors = random.random((layers * n * n, 4)).astype(np.float32)
    triangles = np.concatenate([one + k * n * n for k in range(layers)]).astype(np.int32)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (layers * n * n, 1))
    return clip_space_scene(Mesh(positions.reshape(-1, 4), triangles, colors, normals, True), "foliage")


def references(scene: Scene) -> dict[float, float]:
    """The alpha below which each share of the fragments lies, by bisection on what is discarded."""
    found = {}
    for share in SHARES:
        low, high = 0.0, 1.0
        for _ in range(7 if share else 0):
            middle = (low + high) / 2
            low, high = (middle, high) if _discarded(draw(scene, middle, fidelity="counts")) < share else (low, middle)
        found[share] = low
    return found


def draw(scene: Scene, reference: float, **options: Any) -> Run:
    """Draw with an alpha test."""
    return simulate(
        scene, "cudaraster", MACHINE, width=SIDE, height=SIDE, camera=np.eye(4), cull_backfaces=False,
        alpha_test=reference, **options,
    )  # fmt: skip


def _discarded(run: Run) -> float:
    return run.counts["fine_raster.DISCARDS"] / max(run.counts["fine_raster.ALPHA_LANES"], 1)


def run(progress: Progress) -> Result:
    """Draw foliage at each share with and without compaction."""
    rows = []
    for feature in FEATURES:
        for layers in LAYERS:
            progress(f"features of {feature} pixels, {layers} layers")
            scene = foliage(feature, layers)
            rows += [
                {"feature": feature, "layers": layers, "share": share, **_row(scene, reference)}
                for share, reference in references(scene).items()
            ]
    table = pd.DataFrame(rows)
    cells = [
        reported(f"{row['feature']} px, {row['layers']} layers, {row['share']:.0%} discarded", name, unit, row[key])
        for row in table.to_dict("records")
        for key, name, unit in (
            ("before", "warps that shade are full to", "1"), ("after", ".. compacted", "1"),
            ("pays_from", "compaction pays from a shader of", "instructions"),
        )
        if np.isfinite(row[key])
    ]  # fmt: skip
    return finding(
        "compaction", "Compaction after discard: how full warps are that shade", cells, _figures(table),
        _notes(table), {"shares": table}, folder="exploration",
    )  # fmt: skip


def _row(scene: Scene, reference: float) -> dict[str, float]:
    """Warps that shade, and the shader from which compaction pays by instructions issued."""
    plain, packed = (draw(scene, reference, compact=way) for way in (False, True))
    prices = load_mix("cudaraster", load_machine(MACHINE).compute_capability).kernels
    counts, gathered = ({k[12:]: v for k, v in frame.counts.items()} for frame in (plain, packed))
    saved = counts["SHADE_ROUNDS"] - gathered["SHADE_ROUNDS"]
    compacted = prices["fineRaster: depth compacted"].prices
    step, once = (_issued(compacted[event]) for event in ("COMPACT_ROUNDS", "SHADE_ROUNDS"))
    more = once - _issued(prices["fineRaster: depth tested"].prices["SHADE_ROUNDS"])
    overhead = step * gathered["COMPACT_ROUNDS"] + more * gathered["SHADE_ROUNDS"]
    return {
        "discarded": _discarded(plain),
        "before": counts["SHADE_LANES"] / max(WARP * counts["SHADE_ROUNDS"], 1),
        "after": gathered["SHADE_LANES"] / max(WARP * gathered["SHADE_ROUNDS"], 1),
        "rounds_before": counts["SHADE_ROUNDS"], "rounds_after": gathered["SHADE_ROUNDS"],
        "ms_before": plain.milliseconds, "ms_after": packed.milliseconds,
        "pays_from": overhead / saved if saved > 0 else float("inf"),
        "same": float((plain.image == packed.image).all()),
    }  # fmt: skip


def _issued(price: dict[str, Any]) -> float:
    return sum(float(price.get(kind.name.lower(), 0)) for kind in INSTRUCTION_CLASSES)


def _notes(table: pd.DataFrame) -> list[str]:
    layers, share = SHOWN
    at = {f: table[(table.feature == f) & (table.layers == layers) & (table.share == share)].iloc[0] for f in FEATURES}
    fine, coarse = (at[f] for f in FEATURES)
    some = table[np.isfinite(table.pays_from) & (table.share > 0)]
    one = table[(table.layers == 1) & (table.feature == min(FEATURES)) & (table.share == share)].iloc[0]
    times = table[table.share > 0].ms_after / table[table.share > 0].ms_before
    same = "in all" if table.same.all() else "NOT in all"
    return [
        (
            f"With {share:.0%} discarded in {layers} layers the warps that shade are full to {fine.before:.0%} where"
            f" alpha changes every {FEATURES[0]} pixels and to {coarse.before:.0%} where it changes every"
            f" {FEATURES[1]}; compacted to {fine.after:.0%} and {coarse.after:.0%},"
            f" {fine.rounds_after / fine.rounds_before:.2f} and"
            f" {coarse.rounds_after / coarse.rounds_before:.2f} times the rounds."
        ),
        (
            f"By instructions issued compaction pays from a shader of {some.pays_from.min():.0f} to"
            f" {some.pays_from.max():.0f} instructions, {some.pays_from.median():.0f} in the median; with that of the"
            f" mix, 95, a frame takes {times.min():.2f} to {times.max():.2f} times as long on the {MACHINE}."
        ),
        (
            f"The end of a tile limits it: one layer leaves a tile of 64 pixels {one.after:.0%} full warps at"
            f" {share:.0%} discarded, {layers} layers {fine.after:.0%}."
        ),
        f"Pictures with and without compaction are the same {same} {len(table)} settings.",
        SURE,
    ]


def _figures(table: pd.DataFrame) -> list[Figure]:
    layers, share = SHOWN
    shown = table[table.layers == layers]
    lanes = pd.concat(
        shown.assign(y=shown[way], line=shown.feature.map(f"{{}} px, {name}".format))
        for way, name in (("before", "as they come"), ("after", "compacted"))
    )
    packed = table[table.feature == min(FEATURES)]
    rounds = packed.assign(y=packed.rounds_after / packed.rounds_before, line=packed.layers.map("{} layers".format))
    scene = foliage(max(FEATURES), layers)
    image = draw(scene, references(scene)[share]).image
    return [
        Figure(
            "warps",
            lambda path: lines(
                lanes, path, x="discarded", y="y", by="line", title=f"How full warps that shade are, {layers} layers",
                x_label="share of the fragments discarded", y_label="active lanes / 32",
            ),
        ),
        Figure(
            "rounds",
            lambda path: lines(
                rounds, path, x="discarded", y="y", by="line",
                title=f"Rounds of shading that are left, alpha changing every {min(FEATURES)} pixels",
                x_label="share of the fragments discarded", y_label="rounds compacted / as they come",
            ),
        ),
        Figure(
            "picture",
            lambda path: picture(image, path, title=f"{share:.0%} discarded, {layers} layers, {max(FEATURES)} pixels"),
        ),
    ]  # fmt: skip
