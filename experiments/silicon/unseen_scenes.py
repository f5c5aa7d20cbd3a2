"""The triangles of the scenes that nothing was fitted to, as they were measured.

A library scene seen by its default camera, two views and three soups made here. ``DIGESTS`` tell whether they still are
what the GPU drew: a camera or a reader that changed is noticed, and the scene left out.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from tilestamp.experiments.silicon.inputs import Triangles, seen_by
from tilestamp.simulator.scenes import LookAt

SEED = 20261122
SOUPS = {"soup300_large": (300, 0.05, 0.6), "soup20k_small": (20000, 0.003, 0.03), "soup5k_mixed": (5000, 0.004, 0.4)}
"""Triangles, and their smallest and largest size as a part of half the screen."""
VIEWS = {  # inside a model, and close to one: half of it off the screen
    "inside_bunny": (
        "bunny_5k",
        LookAt(
            eye=(-0.01251980010420084, 0.10973140597343445, 0.024565473198890686),
            target=(0.12712349742650986, 0.09421548247337341, 0.05559731647372246),
            fov_degrees=70.0,
            near=0.0031031842809170485,
            far=0.6206368803977966,
        ),
    ),
    "dragon_close": (
        "dragon_100k",
        LookAt(
            eye=(4.507531678676605, 7.7267677783966064, 8.362483313679695),
            target=(0.9841817021369934, 4.90808779001236, -0.09355668723583221),
            fov_degrees=45.0,
            near=0.14093399047851562,
            far=56.373600006103516,
        ),
    ),
}
DIGESTS = {
    "buddha_100k": "31896af716481668",
    "bunny_5k": "9111c7e6889081fd",
    "cow": "be7609694d00e8bc",
    "di": "49a0520ca1cec050",
    "dragon_close": "3e2296b8a9b907a7",
    "flower": "61a5a75ae3c66c57",
    "icecream_dispenser": "94b8d466e4f53497",
    "inside_bunny": "f64ccbdd906d82f0",
    "littlest_tokyo": "2611582cda55688a",
    "soup20k_small": "267a096d7c72fc9f",
    "soup300_large": "9f9934d955ac2435",
    "soup5k_mixed": "f8bcb3226a520ac6",
    "suzanne": "22152f1542bc795e",
}


def unseen_scenes() -> dict[str, tuple[str, Callable[[], Triangles]]]:
    """Digest of each scene, and what makes it."""
    soups = _soups()
    return {
        name: (digest, partial(soups.__getitem__, name) if name in soups else partial(_model, name))
        for name, digest in DIGESTS.items()
    }


def _model(name: str) -> Triangles:
    """A library scene, by its default camera or by a view of ours."""
    return seen_by(*VIEWS.get(name, (name,)))


def _soups() -> dict[str, Triangles]:
    """Random triangles, sizes log-uniform, in perspective; one stream of numbers for all three."""
    draw = np.random.default_rng(SEED)
    soups = {}
    for name, (count, least, most) in SOUPS.items():
        middle = draw.uniform(-1.1, 1.1, (count, 1, 2))
        size = np.exp(draw.uniform(np.log(least), np.log(most), (count, 1, 1)))
        xy = middle + draw.normal(size=(count, 3, 2)) * size
        z = draw.uniform(-0.9, 0.9, (count, 1, 1)) + draw.normal(size=(count, 3, 1)) * 0.05
        w = np.exp(draw.uniform(-0.3, 0.3, (count, 3, 1)))
        corners = np.concatenate([xy * w, np.clip(z, -0.99, 0.99) * w, w], 2).reshape(-1, 4)
        soups[name] = corners.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(count, 3)
    return soups
