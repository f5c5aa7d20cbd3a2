"""What a cell is: what is executed, and on what it is priced, each resolved from parameters and with a digest."""

import hashlib
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from tilestamp.experiments.harness.sources import sources_digest
from tilestamp.experiments.studies.places import place
from tilestamp.experiments.studies.values import (
    KNOWN,
    PRICED,
    SHARED,
    changed_number,
    is_priced,
    option,
    pixels,
)
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.models.price import FIDELITIES, Fidelity
from tilestamp.models.simt import Simt
from tilestamp.simulator.manifest import mix_manifest, scene_digest
from tilestamp.simulator.options import checked, plain
from tilestamp.simulator.pipelines import options_type, pipeline_options
from tilestamp.simulator.scenes import Scene, load_scene, read_camera
from tilestamp.simulator.scenes.camera import clip_matrix
from tilestamp.simulator.scenes.camera_path import moved_camera

SHAPE = {  # numbers that counting depends on, beside sm.count
    "sm.warp_size", "memory.coalescing", "memory.banks", "memory.bank_lanes", "memory.bank_bytes",
    "memory.bank_mode_bytes", "atomics.merge",
}  # fmt: skip
T = TypeVar("T")


@dataclass(frozen=True)
class Execution:
    """What is executed, but for the SIMT shape of the machine."""

    scene: str | Path | Scene
    scene_digest: str
    pipeline: str
    options: dict[str, Any]
    width: int
    height: int
    matrix: list[list[float]]
    sources: str
    persistent: bool
    """Whether the work depends on the number of SMs."""
    digest: bytes


@dataclass(frozen=True)
class Pricing:
    """On what a run is priced: a machine, changes of its numbers, and how far to go."""

    machine: Machine
    changes: dict[str, Any]
    fidelity: Fidelity
    shapes: tuple[Simt | None, Simt | None]
    """What counting depends on, without and with the number of SMs; None where the changes contradict each other."""
    digest: bytes

    def altered(self) -> Machine:
        """The machine with its changes."""
        return altered(self.machine, self.changes, "assumed", "a study") if self.changes else self.machine


def cell_key(execution: Execution, pricing: Pricing) -> bytes:
    """Digest of all that a cell comes from, 16 bytes."""
    mix = _mix(execution.pipeline, pricing.machine)
    return hashlib.blake2b(execution.digest + pricing.digest + mix, digest_size=16).digest()


@dataclass
class Resolver:
    """Turns parameters into what is executed and what it is priced on; each value is checked once."""

    inputs: dict[tuple[str, str], str] = field(default_factory=dict)
    """Digest of each input that was used, by kind and name."""
    _known: dict[Hashable, Any] = field(default_factory=dict)

    def execution(self, parameters: Mapping[str, Any]) -> Execution:
        """Resolve what is executed; raises StudyError."""
        given: dict[str, Any] = SHARED | {name: value for name, value in parameters.items() if not is_priced(name)}
        if "scene" not in given:
            raise TilestampError("a study needs a scene: scene = ... among what is fixed, or as an axis")
        pipeline = given["pipeline"]
        with place("pipeline"):
            sources = self._input("sources", pipeline, lambda: sources_digest(pipeline))
        with place("size"):
            width, height = pixels(given["size"])
        with place("scene"):
            source = given["scene"]
            scene, digest = self.once(("scene", _name(source)), lambda: _loaded(source))
            self.inputs["scene", scene.name] = digest
        matrix = self._matrix(scene, given, width, height)
        options = self._options(given)
        what = [digest, pipeline, options, width, height, matrix, sources]
        persistent = self.once(("persistent", pipeline), lambda: options_type(pipeline).persistent)
        return Execution(source, digest, pipeline, options, width, height, matrix, sources, persistent, _digest(what))

    def pricing(self, parameters: Mapping[str, Any]) -> Pricing:
        """Resolve on what it is priced; raises StudyError."""
        given = {**PRICED, **parameters}
        with place("machine"):
            machine = self.once(("machine", _name(given["machine"])), lambda: load_machine(given["machine"]))
            self.inputs["machine", machine.name] = machine.digest
        with place("fidelity"):
            if given["fidelity"] not in FIDELITIES:
                raise TilestampError(f"no fidelity {given['fidelity']!r}; there are {', '.join(FIDELITIES)}")
        changes: dict[str, Any] = {}
        for name, value in given.items():
            if "." in name:
                with place(name):
                    key, number = changed_number(machine, name, value)
                    if key in changes:
                        raise TilestampError(f"{key} is changed twice")
                    changes[key] = number
        changes = {key: value for key, value in changes.items() if value != machine.number(key)}
        shape = self._shape(machine, changes)
        shapes = shape and shape._replace(sms=0), shape
        what = [machine.digest, sorted(changes.items()), given["fidelity"]]
        return Pricing(machine, changes, given["fidelity"], shapes, _digest(what))

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Make something once."""
        if key not in self._known:
            self._known[key] = make()
        found: T = self._known[key]
        return found

    def _input(self, kind: str, name: str, digest: Callable[[], str]) -> str:
        if (kind, name) not in self.inputs:
            options_type(name)
            self.inputs[kind, name] = digest()
        return self.inputs[kind, name]

    def _matrix(self, scene: Scene, given: Mapping[str, Any], width: int, height: int) -> list[list[float]]:
        camera, zoom, orbit = given["camera"], given["zoom"], given["orbit"]
        with place("camera"):
            found = self.once(("camera", scene.name, repr(camera)), lambda: read_camera(camera, scene))
        with place("orbit"):
            orbit = checked("orbit", float, orbit)
        with place("zoom"):
            zoom = checked("zoom", float, zoom)
            moved = moved_camera(found, width, height, zoom, orbit)
        matrix: list[list[float]] = clip_matrix(moved, width, height).tolist()
        return matrix

    def _options(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All options of the pipeline; each value is checked by itself, for its place."""
        pipeline = given["pipeline"]
        named = {name: value for name, value in given.items() if name not in KNOWN}
        for name, value in named.items():
            with place(name):
                self.once(("option", pipeline, name, repr(value)), lambda n=name, v=value: option(pipeline, n, v))  # type: ignore[misc]
        return self.once(("options", pipeline, repr(named)), lambda: plain(pipeline_options(pipeline, named)))

    def _shape(self, machine: Machine, changes: Mapping[str, Any]) -> Simt | None:
        """Give what counting depends on, of the machine with its changes."""
        shaping = {key: value for key, value in changes.items() if key in SHAPE}
        try:
            simt = self.once(
                ("shape", machine.digest, repr(sorted(shaping.items()))), lambda: altered(machine, shaping).simt
            )
        except TilestampError:
            return None
        return simt._replace(sms=int(changes.get("sm.count", simt.sms)))


def _name(value: object) -> Hashable:
    """Key of a source: its name, or which object it is."""
    return value if isinstance(value, str | Path) else id(value)


def _loaded(source: str | Path | Scene) -> tuple[Scene, str]:
    scene = load_scene(source)
    return scene, scene_digest(scene)


def _digest(what: object) -> bytes:
    return hashlib.blake2b(msgspec.json.encode(what, order="sorted"), digest_size=16).digest()


_mixes: dict[tuple[str, str], bytes] = {}


def _mix(pipeline: str, machine: Machine) -> bytes:
    """Digest of the mix that prices a pipeline on a machine; nothing where it is fixed function throughout."""
    key = pipeline, machine.compute_capability
    if key not in _mixes:
        mix = mix_manifest(pipeline, machine)
        _mixes[key] = mix["digest"].encode() if mix else b""
    return _mixes[key]
