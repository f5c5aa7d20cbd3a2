"""What made a result: versions, digests of all that went in, the command and the date."""

import hashlib
import os
import platform
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tilestamp
from tilestamp.models import used
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.scenes import Scene

FLOORS = ("models", "simulator", "experiments", "reports")
PACKAGES = ("numpy", "numba", "pandas", "matplotlib", "trimesh")
VARIABLES = ("TILESTAMP_", "NUMBA_", "OMP_", "OPENBLAS_", "MKL_")  # first letters of those that matter
DIGITS = 16  # hexadecimal, of a digest


@dataclass(frozen=True, eq=False)
class Origin:
    """What a run came from, beside what it names itself.

    Parameters
    ----------
    scene_digest : str
        Of the scene's arrays.
    matrix : ndarray, (4, 4), float64
        Model to clip space.
    date : str
        Of the execution, ISO 8601, UTC.
    """

    scene_digest: str
    matrix: NDArray[np.float64]
    date: str


def origin_of(scene: Scene, matrix: NDArray[np.float64]) -> Origin:
    """Describe what a run is about to come from."""
    return Origin(scene_digest(scene), matrix, now())


def now() -> str:
    """Date and time, ISO 8601, UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def source_digest() -> str:
    """Digest of all Python sources of the package, 16 hexadecimal digits."""
    root = Path(tilestamp.__file__).resolve().parent
    digest = hashlib.sha256()
    for floor in FLOORS:
        for path in sorted((root / floor).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:DIGITS]


def scene_digest(scene: Scene) -> str:
    """Digest of what a scene holds, whatever its name: all arrays with their types and shapes."""
    digest = hashlib.sha256()
    for array in _arrays((scene.patches, scene.mesh, *filter(None, [scene.splats]))):
        digest.update(f"{array.dtype}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)  # no copy
    return digest.hexdigest()[:DIGITS]


def _arrays(value: object) -> Iterator[NDArray[Any]]:
    """All arrays in a value, in order; what is none counts as one."""
    if isinstance(value, tuple):
        for item in value:
            yield from _arrays(item)
    elif hasattr(value, "__dataclass_fields__"):
        yield from _arrays(tuple(getattr(value, name) for name in value.__dataclass_fields__))
    else:
        yield np.asarray(value if value is not None else ())


def software(command: str = "") -> dict[str, Any]:
    """Versions, sources, command, date and environment: what every result has in common."""
    return {
        "tilestamp": tilestamp.__version__,
        "source_digest": source_digest(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
        "command": command or shlex.join(sys.argv),
        "date": now(),
        "environment": {name: os.environ[name] for name in sorted(os.environ) if name.startswith(VARIABLES)},
    }


def machine_manifest(machine: Machine) -> dict[str, Any]:
    """Name and digest of a machine, and each changed number: before, after, what kind of number and from where."""
    return {
        "name": machine.name,
        "digest": machine.digest,
        "changes": {
            key: {"from": before, "to": after}
            | dict(zip(("provenance", "source"), machine.provenance[key], strict=True))
            for key, (before, after) in machine.changes.items()
        },
    }


def mix_manifest(pipeline: str, machine: Machine) -> dict[str, str] | None:
    """Name and digest of the mix that prices a pipeline; None where it is fixed function throughout."""
    try:
        mix = load_mix(pipeline, machine.compute_capability)
    except TilestampError:
        return None
    return {"name": mix.name, "digest": mix.digest}


def note_run(scene: str, origin: Origin | None, pipeline: str, machine: Machine, settings: tuple[Any, ...]) -> None:
    """Note a run, its machine, its mix and its scene for the manifest of whoever collects."""
    used.note("machines", machine.name, machine.digest)
    if (mix := mix_manifest(pipeline, machine)) is not None:
        used.note("mixes", mix["name"], mix["digest"])
    if origin is not None:
        used.note("scenes", scene, origin.scene_digest)
        text = f"{origin.scene_digest} {machine.digest} {origin.matrix.tolist()} {settings}"
        digest = hashlib.sha256(text.encode()).hexdigest()[:DIGITS]
        used.note("runs", f"{scene} by {pipeline} on {machine.name}", digest)


def used_manifest(found: used.Used) -> dict[str, dict[str, str]]:
    """What was collected, a digest a name: of several that bore one name, their number and the digest of all."""
    return {kind: {name: _one(found[kind][name]) for name in sorted(found[kind])} for kind in sorted(found)}


def _one(digests: set[str]) -> str:
    if len(digests) == 1:
        return next(iter(digests))
    return f"{len(digests)} of digest {hashlib.sha256(' '.join(sorted(digests)).encode()).hexdigest()[:DIGITS]}"
