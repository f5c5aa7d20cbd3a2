"""Models by name, readers, cameras, subdivision, generators."""

from tilestamp.simulator.scenes.camera import LookAt, ModelToClip
from tilestamp.simulator.scenes.camera_files import read_camera
from tilestamp.simulator.scenes.library import list_scenes, load_scene
from tilestamp.simulator.scenes.scene import Scene

__all__ = ["LookAt", "ModelToClip", "Scene", "list_scenes", "load_scene", "read_camera"]
