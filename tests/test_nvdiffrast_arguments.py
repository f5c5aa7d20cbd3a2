"""nvdiffrast's interface: arrays of other libraries, read-only ones, and what is refused."""

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.nvdiffrast import (
    DepthPeeler,
    antialias_construct_topology_hash,
    arrays,
    interpolate,
    rasterize,
    texture,
    texture_construct_mip,
)
from tilestamp.simulator.stages.laine2011 import pixel_barycentrics

POS = np.array([[[-1, -1, 0, 1], [1, -1, 0.5, 1], [-1, 1, -0.5, 1]]], np.float32)
TRI = np.array([[0, 1, 2]], np.int32)
ATTR = np.array([[1], [2], [3]], np.float32)
CUBE = np.ones((1, 6, 4, 4, 1), np.float32)


class Tensor:
    """Of another library, read as an array, unless it is on a GPU or wants a gradient."""

    def __init__(self, array, error=None):
        self.array, self.error = array, error

    def __array__(self, dtype=None, copy=None):
        if self.error:
            raise self.error
        return self.array


class Tracked(Tensor):
    """As torch's with ``requires_grad``."""

    def detach(self):  # noqa: D102 - torch's
        return Tensor(self.array)


@pytest.mark.parametrize("wrap", [Tensor, lambda array: Tracked(array, RuntimeError("use detach"))])
def test_what_has_an_array_is_taken(wrap):
    assert np.array_equal(rasterize(wrap(POS), wrap(TRI), (8, 8))[0], rasterize(POS, TRI, (8, 8))[0])


def test_a_tensor_on_a_gpu_is_refused_in_a_sentence():
    with pytest.raises(TilestampError, match="pos cannot be read as an array on the CPU: on cuda:0"):
        rasterize(Tensor(POS, TypeError("on cuda:0")), TRI, (8, 8))


def test_read_only_arrays_compile_nothing():
    rasterize(POS, TRI, (8, 8))
    worker = pixel_barycentrics._rows_part
    before = list(getattr(worker, "overloads", ()))
    pos, tri = POS.copy(), TRI.copy()
    pos.flags.writeable = tri.flags.writeable = False
    assert rasterize(pos, tri, (8, 8))[0].any()
    assert list(getattr(worker, "overloads", ())) == before


def test_arguments_are_left_as_they_are():
    pos = POS.copy()
    rasterize(pos, TRI, (8, 8))
    assert np.array_equal(pos, POS)


def test_arrays_that_are_not_contiguous_are_refused_as_there():
    with pytest.raises(TilestampError, match=r"pass np.ascontiguousarray\(pos\)"):
        rasterize(np.repeat(POS, 2, axis=-1)[..., ::2], TRI, (8, 8))


def test_more_triangles_than_float32_has_numbers_for_are_refused(monkeypatch):
    monkeypatch.setattr(arrays, "MOST_TRIANGLES", 2)
    with pytest.raises(TilestampError, match="tri has 3 triangles"):
        antialias_construct_topology_hash(np.repeat(TRI, 3, axis=0))


RAST, RAST_DB = rasterize(POS, TRI, (8, 8))
UV = np.full((1, 8, 8, 2), 0.5, np.float32)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: rasterize(POS, TRI, (8, 8), faults="none"), "faults must be"),
        (lambda: DepthPeeler(POS, TRI, (8, 8), faults="none"), "faults must be"),
        (lambda: texture(CUBE[0], UV, faults="none"), "faults must be"),
        (lambda: rasterize(POS, TRI, (8, 8), None, 1), "grad_db must be a bool"),
        (lambda: DepthPeeler(POS, TRI, (8, 8), None, 1), "grad_db must be a bool"),
        (lambda: interpolate(ATTR, RAST, TRI, RAST_DB, 0), "diff_attrs must be a list"),
        (lambda: interpolate(ATTR, RAST, TRI, RAST_DB, [2**70]), "diff_attrs must be a list"),
        (lambda: texture(CUBE[0, :1], UV, RAST_DB, max_mip_level=-1), "at least 0, not -1"),
        (lambda: texture(CUBE[0, :1], UV, RAST_DB, mip=[], max_mip_level=-1), "at least 0, not -1"),
        (lambda: texture_construct_mip(CUBE[:, :5].copy(), None, True), r"\[B, 6, H, H, C\]"),
    ],
)
def test_other_arguments_are_refused_in_a_sentence(call, sentence):
    with pytest.raises(TilestampError, match=sentence):
        call()


def test_a_list_of_no_attributes_needs_no_derivatives():
    assert interpolate(ATTR, RAST, TRI, None, [])[1].shape == (1, 8, 8, 0)


def test_levels_of_a_cube_map():
    assert [level.shape for level in texture_construct_mip(CUBE, None, True)] == [(1, 6, 2, 2, 1), (1, 6, 1, 1, 1)]
