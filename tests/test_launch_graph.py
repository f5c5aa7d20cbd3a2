"""Launches in a stream and in a graph, on nodes small enough for paper."""

import pytest

from tilestamp.models.launch_graph import Node, as_graph, on_stream

NODES = (
    Node("a", 10.0),
    Node("b", 4.0, ("a",), shares=True),
    Node("c", 6.0, ("a",), shares=True),
    Node("d", 1.0, ("b",)),
)


def test_a_stream_runs_nodes_one_after_another():
    frame = on_stream(NODES, 2.0, 5.0)
    assert (frame.gpu_us, frame.cpu_us, frame.path) == (29.0, 34.0, ("a", "b", "c", "d"))


def test_what_fills_the_machine_holds_up_what_could_run_beside_it():
    """A and the clear from 1; b, which waits for a alone, not before the clear's end at 21."""
    nodes = (Node("a", 3.0), Node("clear", 20.0, fills=True), Node("b", 4.0, ("a",)), Node("c", 2.0, ("b", "clear")))
    frame = as_graph(nodes, 1.0, 0.0)
    assert frame.gpu_us == pytest.approx(21 + 4 + 1 + 2)
    assert frame.path == ("clear", "b", "c")


def test_branches_of_a_graph_share_bandwidth():
    """A to 11; b and c from 12 at half speed: b to 20, c then has 2 left, to 22; d from 21 to 22."""
    frame = as_graph(NODES, 1.0, 5.0)
    assert frame.gpu_us == pytest.approx(22.0)
    assert frame.cpu_us == pytest.approx(27.0)
    assert frame.path in {("a", "c"), ("a", "b", "d")}


def test_a_graph_takes_its_longest_path():
    nodes = [Node("a", 5), Node("b", 1), Node("c", 2, ("a", "b"))]
    assert as_graph(nodes, 1.0, 0.0).path == ("a", "c")
    assert as_graph(nodes, 1.0, 0.0).gpu_us == 9.0


@pytest.mark.parametrize("after", ["a", "b"])
def test_a_node_that_waits_for_itself_or_a_later_one_is_refused(after):
    with pytest.raises(KeyError):
        as_graph([Node("a", 5, (after,)), Node("b", 1)], 1.0, 0.0)
