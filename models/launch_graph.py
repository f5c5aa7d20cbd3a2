"""Launch graphs: the same launches on one stream, one after another, or as a graph whose branches run side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

ROUNDING_US = 1e-9


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
    shares : bool
        Bound by memory: it shares the bandwidth with others that do.
    fills : bool
        Of more blocks than the machine holds: what could run beside it in a graph starts when it ends, as blocks that
        were launched later wait for places.
    """

    name: str
    gpu_us: float
    after: tuple[str, ...] = ()
    shares: bool = False
    fills: bool = False


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
    """Run nodes as soon as what they wait for has ended; the path that ends last decides.

    Nodes that ``shares`` marks divide the memory's bandwidth among those that run together; one that ``fills`` marks
    lets no other one start beside it, and those that it held up start when it ends.

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
    path: dict[str, tuple[str, ...]] = {}
    waiting, running, end = list(nodes), dict[str, float](), dict[str, float]()
    known = {node.name: i for i, node in enumerate(nodes)}
    for node in nodes:
        if any(known[name] >= known[node.name] for name in node.after):
            raise KeyError(node.name)
    shared, filling = {node.name for node in nodes if node.shares}, {node.name for node in nodes if node.fills}
    delayed: dict[str, float] = {}  # start of nodes that wait for nothing any more but a place
    left = {node.name: node.gpu_us for node in nodes}
    now = 0.0
    while waiting or delayed or running:
        for node in [n for n in waiting if all(name in end for name in n.after)]:
            last = max(node.after, key=lambda name: end[name], default=None)
            delayed[node.name] = (0.0 if last is None else end[last]) + step_us
            path[node.name] = (*(path[last] if last is not None else ()), node.name)
            waiting.remove(node)
        pace = {name: 1.0 / max(1, len(shared & running.keys())) if name in shared else 1.0 for name in running}
        next_end = min((now + left[name] / pace[name] for name in running), default=float("inf"))
        starts = () if filling & running.keys() else delayed.values()
        moment = min(next_end, min(starts, default=float("inf")))
        for name in running:
            left[name] -= (moment - now) * pace[name]
        now = moment
        for name in [n for n in running if left[n] <= ROUNDING_US]:
            end[name] = now
            del running[name]
            for held in [n for n, start in delayed.items() if name in filling and start <= now]:
                delayed[held], path[held] = now, (*path[name], held)
        for name in [n for n, start in delayed.items() if start <= now]:
            if not filling & running.keys():
                running[name] = delayed.pop(name)
    longest = max(end, key=lambda name: end[name])
    return FrameTime(end[longest], end[longest] + sync_us, path[longest])
