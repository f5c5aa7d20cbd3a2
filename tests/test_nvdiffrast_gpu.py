"""nvdiffrast's forward interface beside what version 0.4.0 gave on an H200: equal bits, or what difference is left.

Generators of the inputs, outputs and hashes: shared/silicon/nvdiffrast (its README). What is not there skips.
"""

import hashlib
import importlib.util
import json
import sys

import numpy as np
import pytest

from tilestamp.simulator.nvdiffrast import DepthPeeler, antialias, interpolate, rasterize, texture

pytestmark = pytest.mark.shared

RASTERIZE = """
soup100_64 soup1000_129x257 near1000_257x129 slivers2000_129x257 soup5000_512 soup50000_512 near2000_1000x700
far300_64 edges_64 bigtris_512 degenerate_64 grid20000_2048 size_1x1 size_7x9 size_2047x3 size_2049x16
size_16x2049 size_2056x24 batch4_97x130 range4_97x130 badindex_64 nonfinite_64
""".split()  # noqa: SIM905 - as a list it is three times as long
INTERPOLATE = ["batch4_a2", "batch4_a5", "batch4_a5_all", "batch4_a2_list", "range4_a3_none"]
TEXTURE = """
nearest_wrap_7x5c3 linear_wrap_7x5c3 mipnearest_wrap_16x32c4 nearest_clamp_7x5c3 linear_clamp_7x5c3
mipnearest_clamp_16x32c4 nearest_zero_7x5c3 linear_zero_7x5c3 mipnearest_zero_16x32c4
mipnearest_wrap_128x256c2_bias 1x1_linear cube_nearest_16c4 cube_linear_8c3 cube_mipnearest_16c4 cube_linear_1c1
nearest_wrap_nan linear_zero_big
""".split()  # noqa: SIM905 - as a list it is three times as long
TRILINEAR = """
miplinear_wrap_16x32c4 miplinear_clamp_16x32c4 miplinear_zero_16x32c4 miplinear_wrap_64x1c2 cube_miplinear_16c4
""".split()  # noqa: SIM905 - as a list it is three times as long


@pytest.fixture(scope="module")
def folder(shared):
    return shared / "silicon" / "nvdiffrast"


@pytest.fixture(scope="module")
def cases(folder):
    """The module that makes all inputs."""
    sys.path.insert(0, str(folder))
    try:
        spec = importlib.util.spec_from_file_location("nvdiffrast_cases", folder / "cases.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(folder))
    return module


@pytest.fixture(scope="module")
def hashes(folder):
    return json.loads((folder / "hashes.json").read_text())


def bits(array):
    """Bits of float32 values, all NaN alike."""
    array = np.ascontiguousarray(array)
    return np.where(np.isnan(array), np.uint32(0x7FFFFFFF), array.view(np.uint32))


def digests(rast, rast_db):
    """Digest of each plane, as the measurements name them."""
    planes = {"ids_int32": rast[..., 3].astype(np.int32)}
    planes |= {name: bits(rast[..., i]) for i, name in enumerate(("u", "v", "zw"))}
    planes |= {name: bits(rast_db[..., i]) for i, name in enumerate(("dudx", "dudy", "dvdx", "dvdy"))}
    return {name: hashlib.sha256(np.ascontiguousarray(plane).tobytes()).hexdigest() for name, plane in planes.items()}


@pytest.mark.parametrize("case", RASTERIZE)
def test_rasterize_has_every_bit(case, cases, hashes):
    pos, tri, resolution, ranges, _ = (cases.rast_cases() | cases.risky_cases())[case]
    assert digests(*rasterize(pos, tri, resolution, ranges)) == hashes[case]["sha"]


@pytest.mark.parametrize("seed", range(0, 60, 2))
def test_rasterize_has_every_bit_of_random_scenes(seed, cases, folder):
    measured = json.loads((folder / "seeds.json").read_text())[f"seed{seed:03d}"]["sha"]
    width, height, pos, tri, _ = cases.seed_scene(seed)
    found = digests(*rasterize(pos[None], tri, (height, width)))
    assert {name: found[name] for name in measured} == measured


@pytest.mark.parametrize("case", ["soup100_64", "slivers2000_129x257", "bigtris_512", "size_16x2049"])
def test_the_clip_test_of_2024_draws_the_ids_of_0_3_3(case, cases, folder):
    pos, tri, resolution, ranges, _ = cases.rast_cases()[case]
    ids = {clip: rasterize(pos, tri, resolution, ranges, clip=clip)[0][..., 3].ravel() for clip in ("2025", "2024")}
    with np.load(folder / f"{case}.npz") as measured:
        ids["2025"][measured["ids_2024_at"]] = measured["ids_2024"]
        assert len(measured["ids_2024"])
    assert np.array_equal(ids["2024"], ids["2025"])


@pytest.mark.parametrize("case", ["peel_soup_97x130", "peel_spheres_128"])
def test_every_layer_has_every_bit(case, cases, hashes):
    with DepthPeeler(*cases.peel_cases()[case]) as peeler:
        found = [digests(*peeler.rasterize_next_layer()) for _ in range(4)]
    assert found == [hashes[case][f"layer{i}_sha"] for i in range(4)]


@pytest.mark.parametrize("case", INTERPOLATE)
def test_interpolate_has_every_bit(case, folder, hashes):
    name = f"interp_{case}"
    with np.load(folder / f"{name}.npz") as measured:
        wanted = hashes[name]["diff_attrs"]
        given = measured["attr"], measured["rast"], measured["tri"]
        out, out_da = interpolate(*given, measured.get("rast_db"), wanted)
        assert np.array_equal(bits(out), bits(measured["out"]))
        assert wanted is None or np.array_equal(bits(out_da), bits(measured["out_da"]))


@pytest.mark.parametrize("case", TEXTURE)
def test_texture_has_every_bit(case, cases, folder):
    with np.load(folder / f"tex_{case}.npz") as measured:
        assert np.array_equal(bits(texture(**cases.tex_cases()[f"tex_{case}"])), bits(measured["out"]))


@pytest.mark.parametrize("case", TRILINEAR)
def test_between_two_levels_texture_is_within_the_error_of_the_gpus_logarithm(case, cases, folder):
    with np.load(folder / f"tex_{case}.npz") as measured:
        assert np.abs(texture(**cases.tex_cases()[f"tex_{case}"]) - measured["out"]).max() <= 4e-7


@pytest.mark.parametrize("case", ["sphere_96x128_b2", "cube_64_c1"])
def test_antialias_has_every_bit(case, folder):
    with np.load(folder / f"aa_{case}.npz") as measured:
        given = (measured[name] for name in ("color", "rast", "pos", "tri"))
        assert np.array_equal(bits(antialias(*given)), bits(measured["out"]))


@pytest.mark.parametrize("case", ["range_97x130", "soup_97x130"])
def test_where_several_neighbours_meet_antialias_differs_by_the_order_of_additions(case, folder):
    with np.load(folder / f"aa_{case}.npz") as measured:
        out = antialias(*(measured[name] for name in ("color", "rast", "pos", "tri")))
        assert np.abs(out - measured["out"]).max() <= 2e-7
        assert np.count_nonzero((out != measured["out"]).any(axis=-1)) < 0.05 * changed(out, measured["color"])


def changed(out, color):
    """Pixels that took from a neighbour."""
    return np.count_nonzero((out != color).any(axis=-1))
