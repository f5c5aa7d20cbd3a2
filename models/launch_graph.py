"""Launch graphs: the same launches on one stream, one after another, or as a graph whose branches run side by side."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Node:
    """One launch, copy or clear of a frame.

    Parameters
    ----------
    name : str
    gpu_us : float
        Its own duration.
    after : tuple of str
        What it waits for in a graph.
    """

    name: str
    gpu_us: float
    after: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrameTime:
    """Microseconds of one frame.

    Parameters
    ----------
    gpu_us : float
        From the first node's start to the last one's end.
    cpu_us : float
        That the host is kept busy or waiting.
    path : tuple of str
        The nodes that decide ``gpu_us``, in order.
    """

    gpu_us: float
    cpu_us: float
    path: tuple[str, ...]


def on_stream(nodes: Sequence[Node], launch_us: float, sync_us: float) -> FrameTime:
    """Run nodes one after another on one stream.

    Parameters
    ----------
    nodes : sequence of Node
        In launch order.
    launch_us : float
        From the end of one node to the start of the next.
    sync_us : float
        To wait for the end.
    """
    gpu = sum(node.gpu_us + launch_us for node in nodes)
    return FrameTime(gpu, gpu + sync_us, tuple(node.name for node in nodes))


def as_graph(nodes: Sequence[Node], step_us: float, sync_us: float) -> FrameTime:
    """Run nodes as soon as what they wait for has ended; the longest path decides.

    Parameters
    ----------
    nodes : sequence of Node
        Each after those that it waits for.
    step_us : float
        From the end of a node to the start of one that waits for it.
    sync_us : float
        To launch the graph and wait for its end.

    Raises
    ------
    KeyError
        A node that waits for one that does not come before it.
    """
    end: dict[str, float] = {}
    path: dict[str, tuple[str, ...]] = {}
    for node in nodes:
        last = max(node.after, key=lambda name: end[name], default=None)
        start = 0.0 if last is None else end[last]
        end[node.name] = start + step_us + node.gpu_us
        path[node.name] = (*(path[last] if last is not None else ()), node.name)
    longest = max(end, key=lambda name: end[name])
    return FrameTime(end[longest], end[longest] + sync_us, path[longest])
