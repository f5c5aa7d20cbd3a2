"""The architecture picture shows the imports as they are."""

from tests import architecture


def test_the_picture_is_that_of_the_imports():
    hint = "the imports changed: python -m tests.architecture draws the picture anew"
    assert architecture.drawn() == architecture.picture(), hint


def test_a_module_stands_in_the_room_of_its_folder():
    assert architecture.room("tilestamp.simulator.stages.laine2011.clipper") == "simulator.stages.laine2011"
    assert architecture.room("tilestamp.simulator.run") == "simulator"
    assert architecture.room("tilestamp.models.bounds") == "models"


def test_an_arrow_that_follows_from_others_is_left_out():
    arrows = {"a": {"b", "c"}, "b": {"c"}, "c": set()}
    assert architecture.reduced(arrows) == [("a", "b"), ("b", "c")]
