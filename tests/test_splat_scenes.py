"""Splats from files of every kind, and the cameras that see them."""

import json
import zipfile

import numpy as np
import pytest
from PIL import Image

from tilestamp import Scene, TilestampError, load_scene, simulate
from tilestamp.simulator.scenes import list_scenes, read_camera
from tilestamp.simulator.scenes.pinhole import Pinhole, pinhole_camera
from tilestamp.simulator.scenes.splat_view import perspective
from tilestamp.simulator.scenes.splats import Splats
from tilestamp.simulator.stages.kerbl2023.harmonics import colours_seen

NAMES = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
REST = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
PACKED = ("position", "rotation", "scale", "color")
CONSTANT = 0.28209479177387814


def published_ply(path, degree, count=7, seed=1):
    """A file of the published form, and its columns."""
    names = [*NAMES, *(f"f_rest_{k}" for k in range(3 * ((degree + 1) ** 2 - 1))), *REST]
    table = np.random.default_rng(seed).normal(size=(count, len(names))).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    path.write_bytes("\n".join(header).encode() + table.tobytes())
    return dict(zip(names, table.T.astype(float), strict=True))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_published_file_has_log_scales_logits_and_coefficients(tmp_path, degree):
    columns = published_ply(tmp_path / "trained.ply", degree)
    splats = load_scene(tmp_path / "trained.ply").splats
    assert splats.degree == degree
    assert splats.means[:, 1] == pytest.approx(columns["y"])
    assert splats.scales[:, 2] == pytest.approx(np.exp(columns["scale_2"]))
    assert splats.opacities == pytest.approx(1 / (1 + np.exp(-columns["opacity"])))
    assert np.linalg.norm(splats.rotations, axis=1) == pytest.approx(np.ones(7))
    base = 0.5 + CONSTANT * columns["f_dc_2"]
    assert splats.colours[:, 2] == pytest.approx(base if degree else np.maximum(base, 0))
    for k in range((degree + 1) ** 2 - 1):  # all of red, then all of green, then all of blue
        assert splats.harmonics[:, k, 1] == pytest.approx(columns[f"f_rest_{(degree + 1) ** 2 - 1 + k}"])


def naive_colour(splats, i, eye):
    """Colour by the spherical harmonics' polynomials, one coefficient after another."""
    x, y, z = (splats.means[i] - eye) / np.linalg.norm(splats.means[i] - eye)
    c1, c2 = 0.4886025119029199, (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
    c3 = (0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154, 1.445305721320277)
    basis = [-c1 * y, c1 * z, -c1 * x]
    basis += [c2[0] * x * y, -c2[0] * y * z, c2[1] * (2 * z * z - x * x - y * y), -c2[0] * x * z]
    basis += [c2[2] * (x * x - y * y), -c3[0] * y * (3 * x * x - y * y), c3[1] * x * y * z]
    basis += [-c3[2] * y * (4 * z * z - x * x - y * y), c3[3] * z * (2 * z * z - 3 * x * x - 3 * y * y)]
    basis += [-c3[2] * x * (4 * z * z - x * x - y * y), c3[4] * z * (x * x - y * y), -c3[0] * x * (x * x - 3 * y * y)]
    return np.maximum(splats.colours[i] + sum(b * c for b, c in zip(basis, splats.harmonics[i], strict=False)), 0)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_colours_depend_on_the_direction_by_spherical_harmonics(tmp_path, degree):
    published_ply(tmp_path / "trained.ply", degree)
    splats = load_scene(tmp_path / "trained.ply").splats
    view = np.eye(4)
    view[:3, 3] = 0.5, -1.0, 2.0
    colours = colours_seen(splats, perspective(view, 1.0, 1.0))
    for i in range(len(splats)):
        assert colours[i] == pytest.approx(naive_colour(splats, i, -view[:3, 3]), abs=1e-5)


def test_a_mesh_stays_a_mesh(tmp_path):
    (tmp_path / "mesh.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    scene = load_scene(tmp_path / "mesh.ply")
    assert scene.splats is None
    assert len(scene.mesh.triangles) == 1


def test_a_mesh_whose_comment_names_a_colour_of_splats_stays_a_mesh(tmp_path):
    (tmp_path / "mesh.ply").write_text(
        "ply\nformat ascii 1.0\ncomment made from f_dc_0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    assert load_scene(tmp_path / "mesh.ply").splats is None


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (b"element vertex 7", b"element vertex 0", "splats: there are none"),
        (b"element vertex", b"element point", "a splat file without vertex"),
    ],
)
def test_a_file_without_gaussians_says_so(tmp_path, old, new, sentence):
    published_ply(tmp_path / "trained.ply", 1)
    (tmp_path / "broken.ply").write_bytes((tmp_path / "trained.ply").read_bytes().replace(old, new))
    with pytest.raises(TilestampError, match=sentence):
        load_scene(tmp_path / "broken.ply")


def test_a_compressed_file_with_too_few_chunks_says_so(tmp_path):
    bounds = [f"{end}_{axis}" for axis in ("x", "y", "z", "scale_x", "scale_y", "scale_z") for end in ("min", "max")]
    header = ["ply", "format binary_little_endian 1.0", "element chunk 1", *(f"property float {one}" for one in bounds)]
    header += ["element vertex 257", *(f"property uint packed_{one}" for one in PACKED), "end_header", ""]
    (tmp_path / "c.compressed.ply").write_bytes("\n".join(header).encode() + bytes(4 * len(bounds) + 16 * 257))
    with pytest.raises(TilestampError, match="1 chunks has fewer than its 257 Gaussians need"):
        load_scene(tmp_path / "c.compressed.ply")


def test_a_file_that_lacks_a_property_says_which(tmp_path):
    published_ply(tmp_path / "whole.ply", 0)
    broken = (tmp_path / "whole.ply").read_bytes().replace(b"float rot_3", b"float ror_3")
    (tmp_path / "broken.ply").write_bytes(broken)
    with pytest.raises(TilestampError, match="a splat file without rot_3"):
        load_scene(tmp_path / "broken.ply")


def test_arrays_of_an_npz_file_are_taken_to_the_bit(tmp_path):
    draw = np.random.default_rng(2)
    shapes = {"means": (5, 3), "scales": (5, 3), "rotations": (5, 4), "opacities": (5,), "colours": (5, 3)}
    arrays = {name: draw.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    np.savez(tmp_path / "arrays.npz", **arrays)
    splats = load_scene(tmp_path / "arrays.npz").splats
    made = Scene.from_splats(*arrays.values()).splats
    for name, array in arrays.items():
        assert (getattr(splats, name) == array).all()
        assert (getattr(made, name) == array).all()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"means": np.zeros((4, 3))}, "4 means, 5 scales, 5 rotations, 5 opacities, 5 colours differ"),
        ({"rotations": np.zeros((5, 3))}, r"rotations must be \(N, 4\), not \(5, 3\)"),
        ({"colours": [["red"] * 3] * 5}, "colours are not made of numbers"),
        ({name: np.zeros((0, k)) for name, k in (("means", 3), ("scales", 3), ("rotations", 4), ("colours", 3))}
         | {"opacities": []}, "there are none"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_fit_are_refused(change, sentence):
    arrays = {"means": np.zeros((5, 3)), "scales": np.ones((5, 3)), "rotations": np.ones((5, 4))}
    arrays |= {"opacities": np.ones(5), "colours": np.ones((5, 3))}
    with pytest.raises(TilestampError, match=sentence):
        Scene.from_splats(**arrays | change)


def sog_folder(folder, count=6):
    """A small SOG scene whose numbers are simple."""
    folder.mkdir()
    images = np.zeros((5, 8, 4), np.uint8)
    images[0, :count, 0], images[1, :count, 0] = np.arange(count), 128  # low and high bytes of x
    images[2, :count, :3], images[3, :count, :3], images[3, :, 3] = [0, 1, 2], 128, 252
    images[4, :count] = [3, 0, 0, 255]
    names = ("means_l", "means_u", "scales", "quats", "sh0")
    for name, image in zip(names, images, strict=True):
        Image.fromarray(image.reshape(2, 4, 4), "RGBA").save(folder / f"{name}.webp", lossless=True, exact=True)
    meta = {"version": 2, "count": count, "means": {"mins": [-1.0] * 3, "maxs": [1.0] * 3}}
    meta["means"]["files"] = ["means_l.webp", "means_u.webp"]
    meta["scales"] = {"codebook": [-1.0, 0.0, 1.0], "files": ["scales.webp"]}
    meta["quats"] = {"files": ["quats.webp"]}
    meta["sh0"] = {"codebook": [0.0, 1.0, 2.0, -3.0], "files": ["sh0.webp"]}
    (folder / "meta.json").write_text(json.dumps(meta))
    return folder


def test_a_sog_scene_is_a_folder_its_meta_json_or_a_zip(tmp_path):
    folder = sog_folder(tmp_path / "little")
    with zipfile.ZipFile(tmp_path / "little.sog", "w") as archive:
        for path in folder.iterdir():
            archive.write(path, path.name)
    splats = [load_scene(path).splats for path in (folder, folder / "meta.json", tmp_path / "little.sog")]
    logs = -1 + (np.arange(6) + 256 * 128) / 65535 * 2
    for found in splats:
        assert found.means[:, 0] == pytest.approx(np.sign(logs) * (np.exp(np.abs(logs)) - 1), abs=1e-7)
        assert found.scales[0] == pytest.approx(np.exp([-1, 0, 1]))
        assert found.rotations[0, 0] == pytest.approx(1, abs=1e-4)  # the largest part is left out: w
        assert found.colours[0] == pytest.approx([max(0, 0.5 - 3 * CONSTANT), 0.5, 0.5])
        assert (found.opacities == 1).all()


@pytest.mark.parametrize("meta", [[1], None, {"count": -1}, {"count": float("inf")}])
def test_a_sog_scene_of_a_broken_meta_json_says_so(tmp_path, meta):
    folder = sog_folder(tmp_path / "little")
    whole = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(whole | meta if isinstance(meta, dict) else meta))
    with pytest.raises(TilestampError, match="is no whole SOG scene"):
        load_scene(folder)


def test_a_sog_scene_without_a_file_says_so(tmp_path):
    folder = sog_folder(tmp_path / "little")
    (folder / "quats.webp").unlink()
    with pytest.raises(TilestampError, match="is no whole SOG scene"):
        load_scene(folder)


@pytest.mark.shared
@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize(("name", "count"), [("biker", 152_746), ("playbot/6", 1_873), ("garden1", 111_785)])
def test_scenes_on_the_search_path_are_known_by_name(name, count):
    assert len(load_scene(name).splats) == count


def test_the_embedded_scene_has_its_author():
    assert "Stephane Agullo, CC BY" in dict(list_scenes())["playbot"]
    assert len(load_scene("playbot").splats) == 1_873


def camera_fields(size=(96, 72)):
    draw = np.random.default_rng(4)
    view, whole = (draw.normal(size=16).astype(np.float32).tolist() for _ in range(2))
    return {"W": size[0], "H": size[1], "tan_fovx": 0.7, "tan_fovy": 0.5} | {
        "view_row_major": view, "proj_view_row_major": whole,
    }  # fmt: skip


def test_a_camera_of_a_file_is_taken_to_the_bit(tmp_path):
    fields = camera_fields()
    (tmp_path / "cameras.json").write_text(json.dumps({"one": fields}))
    (tmp_path / "scene.json").write_text(json.dumps({"count": 5, "cameras": {"one": fields}}))
    for source in (fields, f"{tmp_path / 'cameras.json'}:one", f"{tmp_path / 'scene.json'}:one"):
        camera = pinhole_camera(read_camera(source), 10, 10)
        assert camera.view.ravel().tolist() == fields["view_row_major"]
        assert camera.proj_view.ravel().tolist() == fields["proj_view_row_major"]
        assert camera.tan_x == np.float32(0.7)


def test_a_view_without_volume_has_no_eye():
    fields = camera_fields() | {"view_row_major": [0.0] * 16}
    with pytest.raises(TilestampError, match="the axes of its view lie in a plane"):
        _ = pinhole_camera(read_camera(fields), 10, 10).eye


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"W": "wide"}, "W and H must be whole numbers"),
        ({"tan_fovx": 0.0}, "tan_fovx and tan_fovy must be over 0"),
        ({"view_row_major": [1.0] * 15}, "view_row_major needs 16 finite numbers"),
        ({"proj_view_row_major": ["a"] * 16}, "proj_view_row_major is not made of numbers"),
    ],
)
def test_a_broken_camera_is_refused(change, sentence):
    with pytest.raises(TilestampError, match=sentence):
        read_camera(camera_fields() | change)


def test_a_picture_has_the_size_of_its_camera_where_none_is_given():
    default = simulate("playbot", "splat", "h200", fidelity="counts", width=96, height=72).image
    pinhole: Pinhole = pinhole_camera(load_scene("playbot").views["default"], 96, 72)
    fields = {"W": 96, "H": 72, "tan_fovx": float(pinhole.tan_x), "tan_fovy": float(pinhole.tan_y)}
    fields |= {"view_row_major": pinhole.view, "proj_view_row_major": pinhole.proj_view}
    assert (simulate("playbot", "splat", "h200", fidelity="counts", camera=fields).image == default).all()


def test_a_picture_is_of_the_usual_size_where_its_view_has_none():
    assert simulate("playbot", "splat", "h200", fidelity="counts", counting=False).image.shape == (768, 1024, 3)


def test_splats_have_a_length():
    zeros = np.zeros((2, 4), np.float32)
    assert len(Splats(zeros[:, :3], zeros[:, :3], zeros, zeros[:, 0], zeros[:, :3])) == 2
