"""Scenes by name: the embedded ones, those on the search path, files, and stand-ins for models that cannot ship.

The reader of each kind of file is imported when such a file is read.
"""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_file
from tilestamp.models.used import note
from tilestamp.simulator.scenes.bpt import read_bpt
from tilestamp.simulator.scenes.camera import Camera, fit_camera
from tilestamp.simulator.scenes.garden import FILE as GARDEN
from tilestamp.simulator.scenes.garden import garden, garden_copies
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.scene import Patches, Scene, Splats, clip_space_scene
from tilestamp.simulator.scenes.search_path import SearchPath, find_scene, missing_scene, scene_files, scene_name
from tilestamp.simulator.scenes.sog import META, is_sog, read_sog
from tilestamp.simulator.scenes.splat_view import view_of
from tilestamp.simulator.scenes.stand_ins import NOT_SHIPPED, cut_like
from tilestamp.simulator.scenes.views import VIEWS

Kind = Literal["patches", "mesh"] | None

DATA = Path(__file__).parent / "data"
EMBEDDED = {
    "teapot": ("teapot.bpt", "Newell's teapot, 32 patches (embedded)"),
    "playbot": ("playbot.sog", "PLAYBOT by Stephane Agullo, CC BY 4.0: 1,873 Gaussian splats (embedded)"),
    "spot": ("spot_control_mesh.obj", "Keenan Crane's cow, a Catmull-Clark cage of 732 patches (embedded)"),
}


LARGE_BYTES, LARGE_TIMES = 2**25, 10  # memory above both (bytes; times the file) is worth a note
CAGE_BYTES = 1400  # a patch, while a cage becomes patches; measured
STAND_IN = "stand-in for "  # first words of its name
STAND_INS = "stand-ins"  # under which a manifest names the models that are not here, each with the file that it lacks
Z_UP = ("teapot", "teacup", "teaspoon", "killeroo")  # all others are taken to have y up


def load_scene(
    source: str | Path | Scene,
    scene_path: SearchPath = None,
    kind: Kind = None,
    texture: NDArray[np.uint8] | None = None,
) -> Scene:
    """Load a scene by name or from a file.

    Parameters
    ----------
    source : str, Path or Scene
        The name of an embedded scene, a file, or the stem or name of a file on the search path. A Scene is given back.
    scene_path : str, Path or sequence of them, optional
        Folders to look in, before those of the environment variable TILESTAMP_SCENES; two levels of sub-folders count.
    kind : {"patches", "mesh"}, optional
        What to make of the file. By default patch files give patches, meshes a mesh, and an OBJ file of mostly quads
        gives both: patches by `approximate_catmull_clark`, and its polygons as a mesh.
    texture : ndarray, (H, W, 4), uint8, optional
        Laid over all triangles of a file by its texture coordinates, in place of the textures that it names.

    Returns
    -------
    Scene
        With the model's named views, ``default`` among them; its note says what was skipped, guessed or left out.

    Raises
    ------
    TilestampError
        Where nothing of the name is found (the sentence says where the file goes) or the file is broken.
    """
    if isinstance(source, Scene):
        return source
    if not isinstance(source, str | Path):
        raise TilestampError(f"a scene is a Scene, a name or a file, not {source!r}")
    source = str(source)
    if garden_copies(source) and (points := find_scene(GARDEN, scene_path)) is not None:
        return garden(points, garden_copies(source))
    path = _resolve(source, scene_path)
    name = source if source in EMBEDDED else scene_name(path)
    try:
        return with_views(_read(name, path, kind, texture))
    except TilestampError:
        raise
    except MemoryError:
        raise TilestampError(f"{path}: needs more memory than there is") from None
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise TilestampError(f"{path}: is broken in a way that its reader has no sentence for ({error})") from error


def list_scenes(scene_path: SearchPath = None) -> list[tuple[str, str]]:
    """List the scenes that can be loaded by name, each with one line of what it is."""
    lines = {name: line for name, (_, line) in EMBEDDED.items()}
    for path in scene_files(scene_path):
        known = path.stem in NOT_SHIPPED and path.suffix == ".bpt"
        if path.name == GARDEN:
            lines.setdefault("garden1", f"the garden of gsplat's profiler; garden5, garden21: its copies ({path})")
            continue
        what = NOT_SHIPPED[path.stem].line if known else f"{path.suffix[1:]} file" if path.suffix else "SOG splats"
        lines.setdefault(scene_name(path), f"{what} ({path})")
    for name, model in NOT_SHIPPED.items():
        lines.setdefault(name, f"{model.line}: not here; put {name}.bpt on the scene search path (TILESTAMP_SCENES)")
    return list(lines.items())


def stand_in(name: str) -> Scene:
    """Give as many patches as a model that is not here has, and of its sizes (``stand_ins``); its note says so."""
    if name not in NOT_SHIPPED:
        raise TilestampError(f"there is no stand-in for {name!r}, only for {' and '.join(NOT_SHIPPED)}")
    model = NOT_SHIPPED[name]
    note(STAND_INS, name, f"{name}.bpt")
    cow = load_scene("spot")
    if cow.patches is None:
        raise TilestampError("the embedded cage is damaged: reinstall")
    low, high = bounds(cow)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if name in Z_UP else np.eye(3)
    points = cut_like(cow.patches, model).points.astype(np.float64)
    points[..., :3] = (points[..., :3] - points[..., 3:] * (low + high) / 2.0) @ (model.scale * turn).T
    said = (
        f"stand-in: {model.patches} patches cut from the embedded spot, because {name} ({model.line}) is not here;"
        f" put {name}.bpt on the scene search path (TILESTAMP_SCENES)"
    )
    scene = with_views(Scene(name, patches=Patches(points.astype(np.float32)), note=said))
    return replace(scene, name=STAND_IN + name)


def is_stand_in(scene: Scene) -> bool:
    """Whether a scene only stands for a model that is not here."""
    return scene.name.startswith(STAND_IN)


def scene_or_stand_in(name: str, scene_path: SearchPath = None) -> Scene:
    """Load a scene, or its stand-in where its file is missing."""
    if name in NOT_SHIPPED and find_scene(name, scene_path) is None:
        return stand_in(name)
    return load_scene(name, scene_path)


def with_views(scene: Scene, up: ArrayLike | None = None) -> Scene:
    """Give a scene the views known for its name, and a fitted ``default`` where they have none."""
    views: dict[str, Camera] = {**VIEWS.get(scene.name, {}), **scene.views}
    if "default" not in views and scene.splats is not None:
        views["default"] = view_of(scene.splats)
    if "default" not in views:
        axis = up if up is not None else (0.0, 0.0, 1.0) if scene.name in Z_UP else (0.0, 1.0, 0.0)
        views["default"] = fit_camera(bounds(scene), axis)
    return replace(scene, views=views)


def bounds(scene: Scene) -> NDArray[np.float64]:
    """Box around all vertices and control points, (2, 3) float64."""
    homogeneous = [scene.patches.points.reshape(-1, 4)] if scene.patches is not None else []
    if scene.mesh is not None:
        used = np.zeros(len(scene.mesh.positions), dtype=np.bool_)
        used[scene.mesh.triangles] = True
        homogeneous.append(scene.mesh.positions[used])
    if not sum(map(len, homogeneous)):
        raise TilestampError(f"the scene {scene.name} has neither patches nor triangles")
    points = np.concatenate(homogeneous).astype(np.float64)
    points = points[:, :3] / points[:, 3:]
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _resolve(source: str, scene_path: SearchPath) -> Path:
    if source in EMBEDDED:
        return DATA / EMBEDDED[source][0]
    path = Path(source)
    if is_file(path) or is_file(path / META):
        return path
    found = find_scene(source, scene_path)
    if found is None:
        if path.parent != Path():
            raise TilestampError(f"there is no scene file {path}")
        known = [name for name, _ in list_scenes(scene_path) if name not in NOT_SHIPPED or find_scene(name, scene_path)]
        raise missing_scene(source, known, scene_path)
    return found


def _read(name: str, path: Path, kind: Kind, texture: NDArray[np.uint8] | None = None) -> Scene:
    if kind not in (None, "patches", "mesh"):
        raise TilestampError(f"kind must be 'patches' or 'mesh', not {kind!r}")
    suffix, notes = path.suffix.lower(), Notes()
    if (splats := _splats(path, notes)) is not None:
        if kind is not None or texture is not None:
            raise TilestampError(f"{path}: has splats, neither patches nor triangles, and no texture fits them")
        return Scene(name, splats=splats, note="; ".join(notes))
    if suffix == ".obj":
        scene = _from_obj(name, path, kind, notes, texture)
    elif suffix == ".bpt":
        scene = Scene(name, patches=read_bpt(path))
    elif kind == "patches":
        raise TilestampError(f"{path}: only .bpt and .obj files can give patches")
    elif suffix == ".npz":
        from tilestamp.simulator.scenes.clip_space import read_clip_space

        scene = clip_space_scene(read_clip_space(path, notes), name)
    else:
        from tilestamp.simulator.scenes.mesh_file import read_mesh

        scene = Scene(name, mesh=read_mesh(path, notes))
    if kind == "mesh":
        from tilestamp.simulator.scenes.subpatches import with_mesh

        scene = replace(with_mesh(scene), patches=None)
    if texture is not None:
        from tilestamp.simulator.scenes.textured_mesh import with_texture

        scene = with_texture(scene, texture)
    _note_size(scene, path, notes)
    return replace(scene, note="; ".join(notes))


def _splats(path: Path, notes: Notes) -> Splats | None:
    """Read the splats of a file that has some; None of another."""
    if is_sog(path):
        return read_sog(path, notes)
    if path.suffix.lower() == ".ply":
        from tilestamp.simulator.scenes.splat_ply import has_splats, read_splat_ply

        return read_splat_ply(path, notes) if has_splats(path) else None
    if path.suffix.lower() == ".npz":
        from tilestamp.simulator.scenes.splat_arrays import has_splat_arrays, read_splat_arrays

        return read_splat_arrays(path, notes) if has_splat_arrays(path) else None
    return None


def _note_size(scene: Scene, path: Path, notes: Notes) -> None:
    """Say where a scene is much larger than its file."""
    parts = [*vars(scene.mesh).values()] if scene.mesh is not None else []
    arrays = [*parts, *(scene.mesh.textures if scene.mesh else ()), scene.patches and scene.patches.points]
    size = sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
    if scene.patches is not None and path.suffix.lower() == ".obj":
        size += CAGE_BYTES * len(scene.patches.points)
    times = size / max(path.stat().st_size, 1)
    large = size > LARGE_BYTES and times > LARGE_TIMES
    notes.add_if(large, f"takes {size / 1e6:,.0f} MB of memory, {times:,.0f} times the file's size")


def _from_obj(name: str, path: Path, kind: Kind, notes: Notes, texture: NDArray[np.uint8] | None = None) -> Scene:
    """Patches of a cage, the mesh of its polygons, or both; of an embedded cage the surface only."""
    from tilestamp.simulator.scenes.approximate_catmull_clark import patches_from_cage
    from tilestamp.simulator.scenes.obj_file import read_obj
    from tilestamp.simulator.scenes.obj_mesh import mesh_from_obj
    from tilestamp.simulator.scenes.quad_cage import cage_of

    model = read_obj(path, texture)
    if kind == "patches" or path.parent == DATA:
        notes += model.notes
        return Scene(name, patches=patches_from_cage(cage_of(model, path)))
    mesh = mesh_from_obj(model, path)
    notes += model.notes
    mostly_quads = 2 * int((model.sizes == 4).sum()) > len(model.sizes)
    if kind == "mesh" or not mostly_quads:
        return Scene(name, mesh=mesh)
    return Scene(name, mesh=mesh, patches=patches_from_cage(cage_of(model, path)))
