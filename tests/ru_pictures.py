"""Small pictures by the pipelines of Ru, tiled and per-primitive."""

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import pipeline_options
from tilestamp.simulator.pipelines.tiled import tiled
from tilestamp.simulator.scenes.camera import LookAt

WIDTH, HEIGHT = 61, 47  # no multiples of a tile
SIMT = Simt(coalescing=2, atomic_merge=0, sms=2)
CAMERA = LookAt((0, 0, 4), (0, 0, 0), fov_degrees=45)


def draw(scene, matrix, pipeline=tiled, **options):
    name = "tiled" if pipeline is tiled else "per-primitive"
    return pipeline(scene, matrix, WIDTH, HEIGHT, SIMT, pipeline_options(name, options), Executor())


def work(frame, kernel):
    return next(w for w in frame.works if w.kernel == kernel)
