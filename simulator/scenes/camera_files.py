"""Read a camera from whatever a user gives: an object, a matrix, a dictionary, a file, the name of a view."""

import json
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.scenes.camera import Camera, LookAt, ModelToClip
from tilestamp.simulator.scenes.library import with_views
from tilestamp.simulator.scenes.pinhole import VIEW_KEY, PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.text_scan import plain_text, read_bytes

MATRIX_KEY = "model_to_clip"
CAMERAS = "cameras"  # of a file that has more than those
CameraSource = Camera | ArrayLike | Mapping[str, Any] | Path | None
OPTIONAL_KEYS = ("fov_degrees", "near", "far")
KEYS = ("eye", "target", "position", "forward", "up", *OPTIONAL_KEYS)
FORMS = '{"model_to_clip"}, {"eye", "target", "up", ...}, {"position", "forward", "up", ...} or {"view_row_major", ...}'


def read_camera(source: CameraSource = None, scene: Scene | Mapping[str, Camera] | None = None) -> Camera:
    """Make a camera of anything that describes one.

    Parameters
    ----------
    source : Camera, array-like of (4, 4), mapping, str, Path or None
        A 4x4 matrix is model to clip space, row-major. A mapping has the key ``model_to_clip``, or ``eye, target, up,
        fov_degrees, near, far``, or ``position, forward, up, fov_degrees, near, far``, or those of a pinhole camera,
        ``W, H, tan_fovx, tan_fovy, view_row_major, proj_view_row_major``. A string is a view's name or
        ``FILE.json``, ``FILE.json:KEY`` or ``FILE.json:KEY:INDEX``; KEY may be one of its
        ``cameras``. None is the view ``default``.
    scene : Scene or mapping of str to Camera, optional
        Where views are looked up; a scene without a view ``default`` gets a fitted one.

    Returns
    -------
    Camera

    Raises
    ------
    TilestampError
        Where nothing of the kind can be made of it; the sentence names the file, view or field.
    """
    if source is None:
        source = "default"
    if isinstance(source, (str, Path)):
        return _by_name(str(source), with_views(scene).views if isinstance(scene, Scene) else scene or {})
    if isinstance(source, Mapping):
        return _from_mapping(source)
    if isinstance(source, (list, tuple, np.ndarray)):
        return ModelToClip(source)
    if isinstance(source, Camera) and callable(source.matrix) and not isinstance(source, type):
        return source
    raise TilestampError(f"camera: {source!r} is not a camera, a 4x4 matrix, a dictionary or a file name")


def _by_name(name: str, views: Mapping[str, Camera]) -> Camera:
    if name in views:
        return views[name]
    path, dot_json, keys = name.partition(".json")
    if not dot_json:
        known = ", ".join(views) or "none"
        near = did_you_mean(name, views)
        raise TilestampError(f"camera {name!r}: no such view{near} (this scene has: {known}) and not a .json file")
    document = _load_json(Path(path + dot_json))
    try:
        for key in keys.split(":")[1:]:
            document = _member(document, key)
        return read_camera(document)
    except TilestampError as error:
        raise TilestampError(f"{name}: {error}") from None


def _load_json(path: Path) -> Any:
    text = plain_text(read_bytes(path))
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise TilestampError(f"{path}:{error.lineno}: not JSON ({error.msg})") from None
    except (ValueError, RecursionError):
        raise TilestampError(f"{path}: the camera file is not text") from None


def _member(document: object, key: str) -> Any:
    """Give the member of a dictionary or list that a part of ``FILE.json:KEY:INDEX`` names."""
    if isinstance(document, Mapping) and key in document:
        return document[key]
    if isinstance(document, Mapping) and isinstance(document.get(CAMERAS), Mapping) and key in document[CAMERAS]:
        return document[CAMERAS][key]
    if isinstance(document, list) and key.isdecimal() and int(key) < len(document):
        return document[int(key)]
    raise TilestampError(f"there is no {key!r} in it; {_what_there_is(document)}")


def _what_there_is(document: object) -> str:
    if isinstance(document, Mapping):
        return "it has " + ", ".join(map(str, document))
    if isinstance(document, list):
        return f"it is a list of {len(document)}"
    return f"it is {document!r}"


def _from_mapping(fields: Mapping[str, Any]) -> Camera:
    if MATRIX_KEY in fields:
        return ModelToClip(fields[MATRIX_KEY])
    if VIEW_KEY in fields:
        return PinholeCamera.from_mapping(fields)
    for key in fields.keys() - KEYS:
        near = get_close_matches(str(key), KEYS, 1, 0.75) or [k for k in OPTIONAL_KEYS if k[:3] == str(key)[:3]]
        if near:
            raise TilestampError(f"camera: {key!r} is no key of a camera (did you mean {near[0]!r}?)")
    options = {key: fields[key] for key in ("up", *OPTIONAL_KEYS) if key in fields}
    if "eye" in fields and "target" in fields:
        return LookAt(fields["eye"], fields["target"], **options)
    if "position" in fields and "forward" in fields:
        position, forward = fields["position"], fields["forward"]
        try:
            target = np.add(position, forward, dtype=np.float64)
        except (TypeError, ValueError):
            raise TilestampError("camera: position and forward need 3 numbers each") from None
        return LookAt(position, target, **options)
    raise TilestampError(f"camera: needs one of the forms {FORMS}; {_what_there_is(fields)}")
