"""The examples do what they say."""

import importlib.util
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_of_a_cube_is_nearer_the_nearer_its_corners_are():
    found = list(example("cube_fitting").errors((0.4, 0.1, 0.02, 0.0), views=8).values())
    assert found == sorted(found, reverse=True)
    assert found[-1] == 0


def test_a_silhouette_of_more_rings_is_nearer_the_finest():
    module = example("silhouettes")
    finest = module.silhouette(*module.sphere(48))
    overlap, area = zip(
        *(module.compare(module.silhouette(*module.sphere(n)), finest) for n in (4, 8, 16)), strict=True
    )
    assert list(overlap) == sorted(overlap)
    assert list(area) == sorted(area, reverse=True)


@pytest.fixture(scope="module")
def oracle():
    return example("port_oracle")


def test_a_port_without_a_bug_differs_nowhere(oracle):
    assert list(oracle.check(oracle.ours, range(2))) == ["pixels"]


@pytest.mark.parametrize(
    ("port", "kind", "cause"),
    [
        ("open_edges", "grid", "fill rule"),
        ("open_edges", "inside", "precision"),
        ("painters", "inside", "depth order"),
        ("no_clipping", "near", "clipping"),
    ],
)
def test_each_bug_is_told_by_its_cause(oracle, port, kind, cause):
    assert oracle.check(getattr(oracle, port), range(2), kinds=(kind,)).most_common(2)[1][0] == cause
