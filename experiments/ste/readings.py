"""What "the sampling hit rate is increased" by a bit mask may mean: each reading, tested on bigguy and the cube (Yao).

The paper says +30 % for bigguy and a factor of 3 for the cube at 7 rounds; not what a patch of the cube is, nor what
counts as a hit. A **useful** hit is one that no other triangle under the same mask has had: the same number with the
mask and without, so that its rate rises as tests fall.
"""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.ste.setting import Model
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import SampleCount, count_tests
from tilestamp.simulator.stages.yao2011.bit_mask import BitMaskEvent, bit_mask

HEIGHTS = (96, 384)  # windows of 4:3
LEVELS = {"bigguy": (2, 3), "cube": (7,)}
WANTED = {"bigguy": 1.30, "cube": 3.0}
TOLERANCE = 0.1
EACH, ONE = "a mask a patch", "one mask for the model"


class Reading(NamedTuple):
    """Gains of one reading at every setting of each model."""

    name: str
    bigguy: list[float]
    cube: list[float]

    def reproduces(self, model: str) -> bool:
        """Whether a setting of the model comes within 10 % of what is published."""
        return any(abs(gain / WANTED[model] - 1) < TOLERANCE for gain in getattr(self, model))


def gains(model: Model, level: int, height: int) -> dict[str, float]:
    """Gain of each reading in one window."""
    width = height * 4 // 3
    polygons, quads = (model.on_screen(level, width, height, triangles=split) for split in (True, False))
    without, with_mask = _plain(polygons, width, height), _masked(polygons, width, height)
    whole = _masked(polygons._replace(patch=np.zeros_like(polygons.patch)), width, height)
    front = _of(polygons, _faces_eye(polygons))
    front_with, front_without = _masked(front, width, height), _plain(front, width, height)
    quads_with, quads_without = _masked(quads, width, height), _plain(quads, width, height)
    return {
        f"hits a test, {EACH}": with_mask.ste / without.ste,
        f"hits a test, {ONE}: its back hides behind the front": whole.ste / without.ste,
        f"useful hits a test, {EACH}": without.tests / with_mask.tests,
        f"useful hits a test, {ONE}": without.tests / whole.tests,
        "front faces alone, before and after": front_with.ste / front_without.ste,
        "front faces alone after, all before": front_with.ste / without.ste,
        "the two triangles of a quad tested at once, before and after": quads_with.ste / quads_without.ste,
        "quads after, triangles before": quads_with.ste / without.ste,
        "nearest triangles of a patch first": _masked(_nearest_first(polygons), width, height).ste / without.ste,
        "before: stamps of 2x2": with_mask.ste / _plain(polygons, width, height, 2).ste,
    }


def readings(models: dict[str, Model], heights: tuple[int, ...] = HEIGHTS) -> list[Reading]:
    """Every reading with its gains at all settings."""
    found = {
        key: [gains(model, level, height) for level in LEVELS[key] for height in heights]
        for key, model in models.items()
    }
    names = found["cube"][0]
    return [Reading(name, *([at[name] for at in found[key]] for key in ("bigguy", "cube"))) for name in names]


def as_table(found: list[Reading]) -> pd.DataFrame:
    """Readings as rows: the span of gains of each model, and which published gains they reproduce."""
    rows: list[dict[str, Any]] = []
    for reading in found:
        row: dict[str, Any] = {"reading": reading.name}
        for model in WANTED:
            values = getattr(reading, model)
            row |= {f"{model}_least": min(values), f"{model}_most": max(values)}
            row[f"{model}_reproduced"] = reading.reproduces(model)
        rows.append(row)
    return pd.DataFrame(rows)


def said(found: list[Reading]) -> list[str]:
    """Say which readings reproduce which claims."""
    both = [reading.name for reading in found if all(map(reading.reproduces, WANTED))]
    alone = {model: [r.name for r in found if r.reproduces(model)] for model in WANTED}
    lines = [f"Readings that reproduce both +30 % and a factor of 3: {'; '.join(both) or 'none'}."]
    lines += [
        f"Readings that reproduce {model}'s {WANTED[model]:g}: {'; '.join(names) or 'none'}."
        for model, names in alone.items()
    ]
    split = {"bigguy": f"useful hits a test, {EACH}", "cube": f"useful hits a test, {ONE}"}
    if all(split[model] in alone[model] for model in WANTED):
        lines.append(
            "One measure gives both, useful hits a test, if bigguy has a mask a patch and the cube is one patch."
        )
    return lines


def _plain(polygons: Micropolygons, width: int, height: int, stamp: int = 1) -> SampleCount:
    return count_tests(polygons, width, height, sample_positions(1), stamp_shape(stamp, "box"))


def _masked(polygons: Micropolygons, width: int, height: int) -> SampleCount:
    """Tests and hits under the plain mask, in sequence."""
    work = bit_mask(polygons, new_samples(width, height, sample_positions(1)), "plain", 1, Simt()).works[0]
    return SampleCount(work.total(BitMaskEvent.SAMPLE_TESTS), work.total(BitMaskEvent.SAMPLE_HITS))


def _of(polygons: Micropolygons, chosen: NDArray[Any]) -> Micropolygons:
    return Micropolygons(polygons.vertices[chosen], polygons.patch[chosen], polygons.shade[chosen])


def _nearest_first(polygons: Micropolygons) -> Micropolygons:
    return _of(polygons, np.lexsort((polygons.vertices[..., 2].mean(axis=1), polygons.patch)))


def _faces_eye(polygons: Micropolygons) -> NDArray[np.bool_]:
    """Triangles that turn the way of the nearest one that has an area."""
    points = polygons.vertices[..., :2].astype(np.float64)
    (ax, ay), (bx, by) = (points[:, 1] - points[:, 0]).T, (points[:, 2] - points[:, 0]).T
    turn = np.sign(ax * by - ay * bx)
    depth = np.where(turn != 0, polygons.vertices[..., 2].mean(axis=1), np.inf)
    facing: NDArray[np.bool_] = turn == turn[depth.argmin()]
    return facing
