"""Models by name, readers, cameras, subdivision, generators."""

from simulator.scenes.camera import LookAt, ModelToClip
from simulator.scenes.camera_files import read_camera
from simulator.scenes.library import list_scenes, load_scene
from simulator.scenes.scene import Scene

__all__ = ["LookAt", "ModelToClip", "Scene", "list_scenes", "load_scene", "read_camera"]
