"""Exact inputs and measurements of the two textured rasterizers on an H200, read from a folder that lies elsewhere.

``TILESTAMP_TEXTURED`` names the folder: ``inputs/SCENE.npz``, ``measured/SCENE.csv.gz`` and ``source_on_cpu/SCENE.csv``
(the authors' kernels on an H200, and the same sources run on a CPU). It is not part of the project, since not all of
the models may be copied. Without it the experiments that need it say so.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.models.errors import MissingInputError
from tilestamp.simulator.scenes.scene import Mesh, Scene

VARIABLE = "TILESTAMP_TEXTURED"
TIME_METRIC = "us_median"
FRAME_METRIC = "us_kernels_and_memsets"
SPAN_METRIC = "us_span"  # of a frame: first start to last end
TIMED = ("cupti", "cupti_repeat2")  # un-profiled; the mean of what there is
COUNTED = "ncu_cold"
READ_BACK = "stats"


@dataclass(frozen=True)
class Measured:
    """What was measured of one scene.

    Parameters
    ----------
    name : str
        Of its files: ``ru_Duck_fit``.
    scene : Scene
        The vertices as the author's kernels got them.
    matrix : ndarray, (4, 4), float64
        Model to clip space.
    width, height : int
        Pixels.
    on_gpu : dict
        By configuration, kernel (the author's name), instance and metric: microseconds (``us_median``), hardware
        counters of a cold cache, and what was read back from the program's buffers.
    on_cpu : dict
        By configuration, kernel and metric: events of the same sources, run thread by thread on a CPU.
    """

    name: str
    scene: Scene
    matrix: NDArray[np.float64]
    width: int
    height: int
    on_gpu: dict[tuple[str, str, int, str], float]
    on_cpu: dict[tuple[str, str, str], float]

    @property
    def configs(self) -> list[str]:
        """Configurations whose frames were timed, in the order in which they were measured."""
        return list(dict.fromkeys(config for config, _, _, metric in self.on_gpu if metric == FRAME_METRIC))


def textured_folder() -> Path:
    """The folder of inputs and measurements.

    Raises
    ------
    MissingInputError
        None is named, or it is not there.
    """
    folder = os.environ.get(VARIABLE, "")
    if not folder or not Path(folder, "inputs").is_dir():
        raise MissingInputError(
            f"measurements of the textured rasterizers lie in a folder that {VARIABLE} names: there is none"
        )
    return Path(folder)


def measured_scenes(system: str) -> list[str]:
    """Names of the scenes that were measured of a system (``ru``, ``zh``) and have an input."""
    folder = textured_folder()
    names = sorted(path.name.removesuffix(".csv.gz") for path in (folder / "measured").glob(f"{system}_*.csv.gz"))
    return [name for name in names if (folder / "inputs" / f"{name}.npz").is_file()]


def read_measured(name: str) -> Measured:
    """Read one scene and all that was measured of it."""
    folder = textured_folder()
    table = pd.read_csv(folder / "measured" / f"{name}.csv.gz")
    on_cpu = pd.read_csv(folder / "source_on_cpu" / f"{name}.csv")
    with np.load(folder / "inputs" / f"{name}.npz") as stored:
        scene = Scene(name, mesh=_mesh(stored))
        matrix, width, height = stored["matrix"], int(stored["width"]), int(stored["height"])
    events = dict(
        zip(on_cpu[["config", "kernel", "metric"]].itertuples(index=False, name=None), on_cpu.value, strict=True)
    )
    return Measured(name, scene, matrix, width, height, _values(table), events)


def _values(table: pd.DataFrame) -> dict[tuple[str, str, int, str], float]:
    """Times, counters and what was read back."""
    times = table.source.isin(TIMED) & table.metric.isin([TIME_METRIC, FRAME_METRIC, SPAN_METRIC])
    chosen = table[times | table.source.isin([COUNTED, READ_BACK])]
    means = chosen.groupby(["config", "kernel", "instance", "metric"], sort=False).value.mean()
    return {(str(c), str(k), int(i), str(m)): float(v) for (c, k, i, m), v in means.items()}


def _mesh(stored: np.lib.npyio.NpzFile) -> Mesh:
    """Arrays of an input as a mesh."""
    textures = tuple(stored[key] for key in sorted(stored.files) if key.startswith("texture") and key != "texture_ids")
    return Mesh(
        positions=stored["positions"],
        triangles=stored["triangles"],
        colors=stored["colors"],
        normals=stored["normals"],
        uvs=stored["uvs"] if bool(stored["has_uvs"]) else None,
        texture_ids=stored["texture_ids"],
        textures=textures,
        draws=stored["draws"][:, :2].astype(np.int64),
    )
