"""nvdiffrast's interpolate, texture and antialias beside slow, obvious versions in double precision."""

import itertools

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.nvdiffrast import (
    antialias,
    antialias_construct_topology_hash,
    interpolate,
    rasterize,
    texture,
    texture_construct_mip,
)

RNG = np.random.default_rng(3)
POS = np.concatenate([RNG.uniform(-1, 1, (2, 12, 3)), np.ones((2, 12, 1))], -1).astype(np.float32)
TRI = np.arange(12, dtype=np.int32).reshape(-1, 3)
RAST, RAST_DB = rasterize(POS, TRI, (20, 30))
ATTR = RNG.uniform(-1, 1, (2, 12, 3)).astype(np.float32)
TEX = RNG.uniform(-1, 1, (2, 4, 8, 3)).astype(np.float32)
CUBE = RNG.uniform(-1, 1, (2, 6, 4, 4, 3)).astype(np.float32)
UV = RNG.uniform(-1.5, 2.5, (2, 6, 7, 2)).astype(np.float32)


def test_interpolate_weighs_the_attributes_of_the_corners():
    out, out_da = interpolate(ATTR, RAST, TRI)
    assert out_da.shape == (2, 20, 30, 0)
    for b, j, i in np.argwhere(RAST[..., 3] > 0)[::11]:
        u, v, _, triangle = RAST[b, j, i].astype(float)
        corners = ATTR[b, TRI[int(triangle) - 1]].astype(float)
        assert np.allclose(out[b, j, i], u * corners[0] + v * corners[1] + (1 - u - v) * corners[2], atol=1e-6)


def test_derivatives_of_attributes_follow_from_those_of_the_weights():
    _, out_da = interpolate(ATTR, RAST, TRI, RAST_DB, [2, -3])
    for b, j, i in np.argwhere(RAST[..., 3] > 0)[::11]:
        corners = ATTR[b, TRI[int(RAST[b, j, i, 3]) - 1]].astype(float)[:, [2, 0]]
        du, dv = RAST_DB[b, j, i, :2].astype(float), RAST_DB[b, j, i, 2:].astype(float)
        wanted = np.outer(corners[0] - corners[2], du) + np.outer(corners[1] - corners[2], dv)
        assert np.allclose(out_da[b, j, i], wanted.reshape(-1), atol=1e-5)


def test_all_attributes_are_differentiated_on_request():
    assert np.array_equal(
        interpolate(ATTR, RAST, TRI, RAST_DB, "all")[1], interpolate(ATTR, RAST, TRI, RAST_DB, [0, 1, 2])[1]
    )


def test_an_attribute_that_does_not_exist_has_no_derivative():
    assert not interpolate(ATTR, RAST, TRI, RAST_DB, [3, -4])[1].any()


def test_one_set_of_attributes_serves_all_images():
    both = interpolate(ATTR[0], RAST, TRI)[0]
    assert np.array_equal(both, interpolate(np.stack([ATTR[0], ATTR[0]]), RAST, TRI)[0])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((ATTR, RAST, TRI, None, [0]), "rast_db"),
        ((ATTR, RAST, TRI, RAST_DB, [0] * 33), "33 entries"),
        ((ATTR, RAST, TRI, RAST_DB, "some"), "'all'"),
        ((ATTR, RAST[:1], TRI), "batches of 1 and 2"),
        ((ATTR.astype(float), RAST, TRI), "attr must be float32"),
    ],
)
def test_interpolate_refuses(arguments, sentence):
    with pytest.raises(TilestampError, match=sentence):
        interpolate(*arguments)


def texel(image, x, y, boundary):
    """A texel of one image, as each boundary mode has it."""
    height, width = image.shape[:2]
    if boundary == "zero" and not (0 <= x < width and 0 <= y < height):
        return np.zeros(image.shape[2])
    if boundary == "wrap":
        return image[y % height, x % width].astype(float)
    return image[min(max(y, 0), height - 1), min(max(x, 0), width - 1)].astype(float)


def naive_linear(image, u, v, boundary):
    x, y = u * image.shape[1] - 0.5, v * image.shape[0] - 0.5
    i, j = int(np.floor(x)), int(np.floor(y))
    s, t = x - i, y - j
    corners = [[texel(image, i + a, j + b, boundary) for a in (0, 1)] for b in (0, 1)]
    return (1 - t) * ((1 - s) * corners[0][0] + s * corners[0][1]) + t * ((1 - s) * corners[1][0] + s * corners[1][1])


@pytest.mark.parametrize("boundary", ["wrap", "clamp", "zero"])
def test_linear_filtering_beyond_the_borders(boundary):
    out = texture(TEX, UV, boundary_mode=boundary)
    for b, j, i in np.ndindex(2, 6, 7):
        u, v = UV[b, j, i].astype(float)
        assert np.allclose(out[b, j, i], naive_linear(TEX[b], u, v, boundary), atol=3e-6)


@pytest.mark.parametrize("boundary", ["wrap", "clamp", "zero"])
def test_the_nearest_texel_is_the_one_that_holds_the_coordinate(boundary):
    out = texture(TEX, UV, filter_mode="nearest", boundary_mode=boundary)
    for b, j, i in np.ndindex(2, 6, 7):
        u, v = UV[b, j, i].astype(float)
        x, y = int(np.floor(u * 8)), int(np.floor(v * 4))
        assert np.array_equal(out[b, j, i], texel(TEX[b], x, y, boundary))


def test_levels_are_averages_of_four_texels():
    levels = texture_construct_mip(TEX)
    assert [level.shape[1:3] for level in levels] == [(2, 4), (1, 2), (1, 1)]
    assert np.allclose(levels[0], TEX.reshape(2, 2, 2, 4, 2, 3).mean(axis=(2, 4)), atol=1e-6)
    assert np.allclose(levels[2], TEX.mean(axis=(1, 2), keepdims=True), atol=1e-6)


def test_the_longer_axis_of_the_footprint_chooses_the_level():
    uv = np.full((1, 1, 3, 2), 0.5, np.float32)
    texels = np.array([1, 2, 4], np.float32)  # a pixel steps over as many
    uv_da = np.zeros((1, 1, 3, 4), np.float32)
    uv_da[0, 0, :, 0] = texels / 8
    out = texture(TEX[:1], uv, uv_da, filter_mode="linear-mipmap-nearest")
    levels = [TEX[:1], *texture_construct_mip(TEX[:1])]
    wanted = [texture(levels[n], uv[:, :, n : n + 1])[0, 0, 0] for n in range(3)]
    assert np.allclose(out[0, 0], wanted, atol=1e-6)


def test_between_levels_values_are_interpolated():
    uv, bias = np.full((1, 1, 1, 2), 0.3, np.float32), np.full((1, 1, 1), 0.25, np.float32)
    out = texture(TEX[:1], uv, mip_level_bias=bias)
    low, high = texture(TEX[:1], uv), texture(texture_construct_mip(TEX[:1])[0], uv)
    assert np.allclose(out, 0.75 * low + 0.25 * high, atol=1e-6)


def test_no_level_beyond_the_last_is_taken():
    uv, bias = UV[:1], np.full((1, 6, 7), 50, np.float32)
    out = texture(TEX[:1], uv, mip_level_bias=bias, max_mip_level=1)
    assert np.allclose(out, texture(texture_construct_mip(TEX[:1])[0], uv), atol=1e-6)


def test_given_levels_are_used():
    uv, bias = UV[:1], np.ones((1, 6, 7), np.float32)
    level = np.full((1, 2, 4, 3), 7, np.float32)
    assert np.allclose(texture(TEX[:1], uv, mip_level_bias=bias, mip=[level]), 7)


def directions(count):
    return np.random.default_rng(8).normal(size=(1, 1, count, 3)).astype(np.float32)


def test_a_cube_map_of_one_colour_a_face_gives_that_of_the_longest_component():
    faces = np.arange(6, dtype=np.float32)[None, :, None, None, None] * np.ones((1, 6, 4, 4, 1), np.float32)
    d = directions(200)
    axis = np.abs(d[0, 0]).argmax(axis=1)
    wanted = 2 * axis + (d[0, 0][np.arange(200), axis] < 0)
    out = texture(faces, d, filter_mode="nearest", boundary_mode="cube")
    assert np.array_equal(out[0, 0, :, 0], wanted)


def test_a_cube_map_is_continuous_across_edges_and_corners():
    ends = np.array(list(itertools.product((-1, 0, 0.4, 1), repeat=3)))
    places = ends[np.abs(ends).max(axis=1) == 1]
    turned = places + 1e-5 * np.random.default_rng(1).normal(size=(20, *places.shape))
    out = texture(CUBE[:1], turned[None].astype(np.float32), boundary_mode="cube")[0]
    assert np.abs(out - out[0]).max() < 1e-3


def cube_corner(**options):
    """The lookup at a corner of the second cube map of a batch."""
    d = np.array([[[[1, 1, 1.0001]]]] * 2, np.float32)
    return texture(CUBE, d, boundary_mode="cube", **options)[1, 0, 0]


def test_a_mended_corner_of_the_second_cube_map_is_that_of_the_map_alone():
    d = np.array([[[[1, 1, 1.0001]]]], np.float32)
    assert np.array_equal(cube_corner(faults="mended"), texture(CUBE[1:], d, boundary_mode="cube")[0, 0, 0])


def test_a_kept_corner_of_the_second_cube_map_shows_the_map_before_it():
    assert not np.array_equal(cube_corner(), cube_corner(faults="mended"))


def test_a_direction_of_no_length_shows_nothing():
    assert not texture(CUBE[:1], np.zeros((1, 1, 1, 3), np.float32), boundary_mode="cube").any()


@pytest.mark.parametrize(
    ("arguments", "options", "sentence"),
    [
        ((TEX, UV), {"filter_mode": "cubic"}, "not 'cubic'"),
        ((TEX, UV), {"boundary_mode": "mirror"}, "not 'mirror'"),
        ((TEX, UV), {"filter_mode": "linear-mipmap-linear"}, "needs uv_da"),
        ((TEX[:, :3].copy(), UV), {"mip_level_bias": np.zeros((2, 6, 7), np.float32)}, "has no half"),
        ((TEX[:, :3].copy(), UV[:1]), {}, "batches of 2 and 1"),
        ((CUBE[:, :, :2].copy(), np.ones((2, 1, 1, 3), np.float32)), {"boundary_mode": "cube"}, r"\[B, 6, H, H, C\]"),
        ((TEX, UV), {"boundary_mode": "cube"}, r"\[B, 6, H, H, C\]"),
    ],
)
def test_texture_refuses(arguments, options, sentence):
    with pytest.raises(TilestampError, match=sentence):
        texture(*arguments, **options)


def half_plane(edge):
    """A big triangle that covers all pixels left of a vertical line, 8 x 8 pixels."""
    x = 2 * edge / 8 - 1
    pos = np.array([[[x, -9, 0, 1], [x, 9, 0, 1], [-9, 0, 0, 1]]], np.float32)
    return pos, np.array([[0, 1, 2]], np.int32)


@pytest.mark.parametrize("edge", [3.6, 3.9, 4.1, 4.4])
def test_the_pixel_that_a_silhouette_cuts_gets_its_share_of_colour(edge):
    pos, tri = half_plane(edge)
    rast, _ = rasterize(pos, tri, (8, 8))
    color = (rast[..., 3:] > 0).astype(np.float32)
    out = antialias(color, rast, pos, tri)[0, 4, :, 0]
    assert np.allclose(out, np.clip(edge - np.arange(8), 0, 1), atol=1e-6)


@pytest.mark.parametrize("edge", [3.6, 4.4])
def test_a_silhouette_before_a_farther_triangle_blends_along_both_axes(edge):
    pos, _ = half_plane(edge)
    behind = np.array([[[-9, -9, 0.5, 1], [9, -9, 0.5, 1], [0, 9, 0.5, 1]]], np.float32)
    pos, tri = np.concatenate([pos, behind], axis=1), np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    for axes in ([0, 1, 2, 3], [1, 0, 2, 3]):
        turned = pos[..., axes].copy()
        rast, _ = rasterize(turned, tri, (8, 8))
        out = antialias((rast[..., 3:] == 1).astype(np.float32), rast, turned, tri)[0, ..., 0]
        along = out[4] if axes[0] == 0 else out[:, 4]
        assert np.allclose(along, np.clip(edge - np.arange(8), 0, 1), atol=1e-6)


def test_an_edge_between_triangles_of_one_surface_blends_nothing():
    pos = np.array([[[-2, -2, 0, 1], [2, -2, 0, 1], [-2, 2, 0, 1], [2, 2, 0, 1]]], np.float32)
    tri = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    rast, _ = rasterize(pos, tri, (8, 8))
    color = RNG.uniform(0, 1, (1, 8, 8, 3)).astype(np.float32)
    assert np.array_equal(antialias(color, rast, pos, tri), color)


def test_the_vertex_across_an_edge_is_that_of_the_neighbour():
    tri = np.array([[0, 1, 2], [1, 3, 2], [5, 5, 6], [-1, 2, 3]], np.int32)
    found = antialias_construct_topology_hash(tri).opposite
    assert found.tolist() == [[3, -1, -1], [-1, 0, -1], [-1, -1, -1], [-1, -1, -1]]


def test_of_an_edge_of_three_triangles_the_first_two_are_neighbours():
    tri = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]], np.int32)
    assert antialias_construct_topology_hash(tri).opposite[:, 2].tolist() == [3, 2, -1]


def test_a_hash_made_before_gives_the_same_picture():
    color = RNG.uniform(0, 1, (2, 20, 30, 2)).astype(np.float32)
    made = antialias_construct_topology_hash(TRI)
    assert np.array_equal(antialias(color, RAST, POS, TRI, made), antialias(color, RAST, POS, TRI))


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"color": np.zeros((2, 20, 31, 1), np.float32)}, "different sizes"),
        ({"color": np.zeros((1, 20, 30, 1), np.float32)}, "batches of 1 and 2"),
        ({"pos": POS[:1]}, "batches of 1 and 2"),
        ({"topology_hash": antialias_construct_topology_hash(TRI[:2])}, "the same tri"),
        ({"topology_hash": TRI}, "antialias_construct_topology_hash"),
    ],
)
def test_antialias_refuses(changed, sentence):
    given = {"color": np.zeros((2, 20, 30, 1), np.float32), "rast": RAST, "pos": POS, "tri": TRI}
    with pytest.raises(TilestampError, match=sentence):
        antialias(**(given | changed))
