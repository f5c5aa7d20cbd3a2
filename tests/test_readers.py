"""Readers of scenes, what trips others over and what is left out: patches, images, and all kinds of files."""

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from tests.reader_files import SQUARE, TEXTURED
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.scenes.images import read_image

# Bezier patches


def test_headed_patches_of_lower_degree_are_raised(load):
    points = "".join(f"{x} {y} 0\n" for y in (0, 3) for x in (0, 3))
    net = load("a.bpt", "1\n1 1\n" + points).patches.points.reshape(4, 4, 4)
    np.testing.assert_allclose(net[..., 0], np.tile([0, 1, 2, 3], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(net[..., 1], np.tile([[0], [1], [2], [3]], (1, 4)), atol=1e-6)


def test_a_headed_patch_may_have_two_degrees(load):
    net = load("a.bpt", "1\n1 2\n0 0 0\n1 0 0\n2 0 0\n0 3 0\n1 3 0\n2 3 0\n").patches.points.reshape(4, 4, 4)
    np.testing.assert_allclose(net[:, 0, 1], [0, 1, 2, 3], atol=1e-6)
    np.testing.assert_allclose(net[0, :, 0], [0, 2 / 3, 4 / 3, 2], atol=1e-6)


def test_headed_patches_of_degree_three_are_as_they_stand(load):
    points = "".join(f"{i} {2 * i} {3 * i}\n" for i in range(16))
    patches = load("a.bpt", "2\n" + ("3 3\n" + points) * 2).patches.points
    assert patches.tolist() == [[[i, 2 * i, 3 * i, 1] for i in range(16)]] * 2


def test_a_headed_patch_of_higher_degree_is_named(load):
    with pytest.raises(TilestampError, match=r"a\.bpt:19: the degrees \(1 to 3\) of patch 2"):
        load("a.bpt", "2\n3 3\n" + "0 0 0\n" * 16 + "5 3\n" + "0 0 0\n" * 24)


# Images


def test_grey_of_16_bits_is_scaled():
    png16 = np.array([[0x4000, 0x8000, 0xFFFF]], np.uint16)
    data = encoded(3, 1, 16, 0, png16.astype(">u2").tobytes())
    assert read_image(data, "it")[0].tolist() == [[64, 64, 64, 255], [128, 128, 128, 255], [255, 255, 255, 255]]


def encoded(width, height, bits, kind, row, *chunks):
    """Give a PNG of one row, by the specification."""

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    extra = b"".join(chunk(*one) for one in chunks)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + extra
        + chunk(b"IDAT", zlib.compress(b"\0" + row))
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize(
    ("bits", "kind", "row", "chunks"),
    [
        (16, 0, b"\x40\x00\x80\x00", [(b"tRNS", b"\x80\x00")]),
        (8, 0, b"\x40\x80", [(b"tRNS", b"\0\x80")]),
        (8, 3, b"\0\1", [(b"PLTE", bytes([64, 64, 64, 128, 128, 128])), (b"tRNS", b"\xff\0")]),
        (8, 2, b"\x40\x40\x40\x80\x80\x80", [(b"tRNS", b"\0\x80\0\x80\0\x80")]),
        (16, 2, b"\x40\0\x40\0\x40\0\x80\0\x80\0\x80\0", [(b"tRNS", b"\x80\0\x80\0\x80\0")]),
        (8, 4, b"\x40\xff\x80\0", []),
    ],
)
def test_transparency_of_every_kind_of_png(bits, kind, row, chunks):
    image = read_image(encoded(2, 1, bits, kind, row, *chunks), "it")
    assert image[0, :, 0].tolist() == [64, 128]
    assert image[0, :, 3].tolist() == [255, 0]


def test_an_image_too_large_to_decode_is_a_sentence():
    with pytest.raises(TilestampError, match=r"not an image that can be read .*pixels"):
        read_image(encoded(40000, 40000, 8, 0, b""), "it")


# All kinds


def test_arrays_that_are_not_read_are_named(tmp_path):
    corners = np.float32([[-1, -1, 0, 1], [1, -1, 0, 1], [0, 1, 0, 1]])
    np.savez(tmp_path / "a.npz", positions=corners, triangles=np.int32([[0, 1, 2]]), colors=corners)
    assert "colors" in load_scene(tmp_path / "a.npz").note


def test_a_kind_that_needs_a_module_names_the_extra(tmp_path, monkeypatch):
    import trimesh

    def missing(*_, **__):
        raise ModuleNotFoundError("No module named 'lxml'", name="lxml")

    monkeypatch.setattr(trimesh, "load_scene", missing)
    (tmp_path / "a.3mf").write_bytes(b"PK")
    with pytest.raises(TilestampError, match=r"needs a module .*lxml.*: install tilestamp\[formats\]"):
        load_scene(tmp_path / "a.3mf")


def test_a_scene_much_larger_than_its_file_says_so(tmp_path):
    Image.new("RGB", (3000, 3000)).save(tmp_path / "t.png")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + SQUARE + TEXTURED)
    assert "times the file's size" in load_scene(tmp_path / "a.obj").note


def test_a_cage_that_needs_much_more_memory_than_its_file_says_so(load):
    rows = np.arange(156 * 156).reshape(156, 156)
    quads = np.stack([rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]], axis=-1).reshape(-1, 4) + 1
    text = "".join(f"v {k % 156} {k // 156} 0\n" for k in range(156 * 156))
    text += "".join("f {} {} {} {}\n".format(*quad) for quad in quads.tolist())
    assert "times the file's size" in load("a.obj", text).note


def test_a_note_is_shown_on_the_terminal(tmp_path, capsys):
    from tilestamp.experiments.command_line import run_command

    (tmp_path / "a.obj").write_text(SQUARE + "l 1 2\nf 1 2 3\n")
    command = ["render", str(tmp_path / "a.obj"), "--pipeline", "freepipe", "--machine", "gtx480", "--size", "32x32"]
    assert run_command(command) == 0
    assert "statements that are not read: l (1)" in capsys.readouterr().out
