"""Frames of splats that were executed once: judging what was fitted prices an experiment again for each number."""

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

from tilestamp.simulator.frame import Frame
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate

_DONE: dict[Hashable, Run] = {}


def executed(scene: Scene, machine: str, view: Hashable = "", **given: Any) -> Run:
    """Draw a frame the first time, and give its works, without pictures and lists, to be priced as mixes are now.

    Parameters
    ----------
    scene : Scene
    machine : str
    view : hashable
        Name of the camera, where one is given.
    **given
        As ``simulate`` takes them.
    """
    key = scene.name, machine, view, tuple(sorted((k, v) for k, v in given.items() if k != "camera"))
    if key not in _DONE:
        run = simulate(scene, "splat", machine, **given)
        _DONE[key] = replace(run, frame=Frame.numbers(run.frame.works, run.frame.facts))
    return replace(_DONE[key])
