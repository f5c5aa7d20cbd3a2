"""What each pipeline can draw: of the embedded scenes, the teapot or the splats."""

from typing import Any

from tilestamp.simulator.pipelines import options_type
from tilestamp.simulator.scenes import Scene, load_scene, read_camera
from tilestamp.simulator.scenes.pinhole import pinhole_camera


def scene_for(pipeline: str) -> str:
    """Name of an embedded scene that a pipeline draws."""
    return "playbot" if options_type(pipeline).splats else "teapot"


def seen(pipeline: str, width: int, height: int) -> tuple[Scene, Any]:
    """That scene, and its default view as the pipeline takes it."""
    scene = load_scene(scene_for(pipeline))
    camera = read_camera("default", scene)
    if options_type(pipeline).splats:
        return scene, pinhole_camera(camera, width, height)
    return scene, camera.matrix(width, height)
