"""The triangles of the scenes that the fits could see: those in ``measured/seen/ids``, and two of Stanford's models."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from tilestamp.experiments.silicon.inputs import Triangles, seen_by
from tilestamp.simulator.scenes import ModelToClip

SEEN = Path(__file__).parent / "measured" / "seen"
MODELS = {  # file, camera as it was measured
    "bunny": (
        "bunny",
        ModelToClip(
            [
                [1.775498375255529, 0.0, -0.355099674802296, 0.029354492168800882],
                [-0.11273005510909614, 2.344785156399944, -0.5636502795476402, -0.26105222503474607],
                [-0.19143095868672205, -0.239288699099639, -0.9571547915500224, 0.24621519609582784],
                [-0.1904761908936635, -0.2380952392474913, -0.9523809496800173, 0.2697441507538244],
            ]
        ),
    ),
    "dragon100k": (
        "dragon_100k",
        ModelToClip(
            [
                [1.709006733295795, 0.0, -0.5981523548999956, 0.0],
                [-0.18316031775800176, 2.3496852201956715, -0.523315194767107, -11.677818056534857],
                [-0.3231322802271961, -0.23080877150442525, -0.9232350874818934, 15.181603143855568],
                [-0.32152064826724697, -0.22965760556066594, -0.9186304263727555, 16.65319717890884],
            ]
        ),
    ),
}
DIGESTS = {
    "bunny": "a304cc3d44c8d189",
    "dragon100k": "adc98c184a9152a1",
    "edges_512": "f7e3c95aeb33463c",
    "nearclip5k": "0a308ab3bea16794",
    "soup2k": "eb8caf65011ba415",
    "teapot16k": "a8771a86ca5b5f98",
}


def seen_scenes() -> dict[str, tuple[str, Callable[[], Triangles]]]:
    """Digest of each scene, and what makes it."""
    return {name: (digest, partial(_make, name)) for name, digest in DIGESTS.items()}


def _make(name: str) -> Triangles:
    if name in MODELS:
        return seen_by(*MODELS[name])
    with np.load(SEEN / "ids" / f"{name}_input.npz") as stored:
        return stored["positions"], stored["triangles"]
