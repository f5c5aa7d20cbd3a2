"""Lists of fragments: the picture that needs no order of input, what finds no room, and what is counted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_blend as naive
from tests.test_programmable_rop import layer, soup
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.laine2011.fragment_lists import LAYOUTS, ListEvent, keep_fragments
from tilestamp.simulator.stages.laine2011.resolve_lists import ResolveEvent, resolve_lists

SIZE = (19, 13)
ROOM = {"linked": 1, "round": 1, "chunked": 5, "fixed": 40}


def keep(what, layout, room=None, size=SIZE):
    positions, triangles, colors = what
    setup, lists = naive.prepared(positions, triangles, size)
    return keep_fragments(setup, *lists, *size, Simt(), layout=layout, room=room or ROOM[layout], colors=colors)


def draw(what, layout, room=None, size=SIZE):
    (buffers, lists), works, facts = keep(what, layout, room, size)
    _, resolved, _ = resolve_lists(lists, buffers.color[0], Simt())
    return buffers.color[0, : size[1], : size[0]], works[0], resolved[0], facts


def off(picture, found):
    """Largest distance of a picture from exact composition, in steps of a byte."""
    wanted = np.zeros((*picture.shape, 4))
    for place, entries in found.items():
        wanted[place] = naive.exact(entries)
    shown = np.stack([(picture >> shift) & 255 for shift in (0, 8, 16, 24)], axis=-1)
    return np.abs(shown - 255 * wanted).max()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_byte_is_the_nearest_to_exact_composition(layout):
    what = soup(11, 30)
    assert off(draw(what, layout)[0], naive.fragments(*what, SIZE)) < 0.5 + 1e-3


@given(st.integers(0, 10**6))
@settings(max_examples=6, derandomize=True, deadline=None)
def test_the_picture_needs_no_order_of_input(seed):
    positions, triangles, colors = soup(seed, 12)
    shuffled = triangles[np.random.default_rng(seed).permutation(len(triangles))]
    one, other = (draw((positions, order, colors), "linked")[0] for order in (triangles, shuffled))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_of_equal_depths_the_later_lies_in_front(layout):
    positions, _, colors, size = layer(1.0, (8, 8))
    colors = np.concatenate([colors, colors * [0, 1, 0, 1]]).astype(np.float32)
    made = draw((np.tile(positions, (2, 1)), [[0, 1, 2], [3, 4, 5]], colors), layout, 4, size)[0]
    assert set(made.ravel()) == {0xFF00FF00}


@pytest.mark.parametrize("room", [1, 2, 3, 5])
def test_a_fixed_list_keeps_the_first_of_a_pixel_and_counts_the_rest(room):
    what = soup(12, 30)
    found = naive.fragments(*what, SIZE)
    made, work, _, facts = draw(what, "fixed", room)
    lost = sum(max(0, len(entries) - room) for entries in found.values())
    assert facts["fragments_lost"] == work.total(ListEvent["LOST"]) == lost > 0
    assert off(made, {place: entries[:room] for place, entries in found.items()}) < 0.5 + 1e-3


@pytest.mark.parametrize(("layout", "lanes_of"), [("linked", 1), ("round", 32), ("chunked", 5)])
def test_atomics_on_the_counter_of_nodes(layout, lanes_of):
    what, size = soup(13, 40), (24, 8)  # three tiles
    tiles = [0, 0, 0]
    for (_, x), entries in naive.fragments(*what, size).items():
        tiles[x // 8] += len(entries)
    work = keep(what, layout, size=size).works[0]
    starts = 20 * Simt().sms + len(tiles)  # draws of tiles
    lanes = sum(-(-n // lanes_of) for n in tiles)
    instructions = sum(-(-n // max(lanes_of, 5 if layout == "chunked" else 32)) for n in tiles)
    assert work.total(ListEvent["ATOMIC_LANES"]) - starts == lanes
    assert work.total(ListEvent["ATOMIC_DEPTH"]) - starts == lanes
    assert work.total(ListEvent["ATOMIC"]) - starts == work.total(ListEvent["ALLOCATIONS"]) == instructions
    assert work.total(ListEvent["ATOMIC_CONFLICTS"]) == lanes - instructions
    assert list(work.atomic_requests) == [starts, lanes]


def test_an_allocation_loads_nothing():
    works = [draw(soup(8, 30), layout)[1] for layout in LAYOUTS]
    loads = ListEvent["LOAD_TRANSACTIONS"], ListEvent["LOAD_BYTES"]
    assert len({tuple(work.total(event) for event in loads) for work in works}) == 1


def test_fixed_lists_want_no_atomic():
    work = keep(soup(13), "fixed").works[0]
    assert work.total(ListEvent["ALLOCATIONS"]) == 0
    assert work.atomic_requests[1] == 0


def sectors(addresses, size):
    return len({byte // 32 for a in addresses for byte in (a, a + size - 1)})


def rounds_of(what, size):
    """Pixels of the fragments of one tile, 32 at a time."""
    places = [(t, y, 7 - x) for (y, x), entries in naive.fragments(*what, size).items() for _, _, t in entries]
    order = [8 * y + x for _, y, x in sorted(places)]
    return [order[i : i + 32] for i in range(0, len(order), 32)]


@pytest.mark.parametrize("layout", ["round", "fixed"])
def test_stores_of_a_round_are_nodes_side_by_side_or_the_layers_of_its_pixels(layout):
    what, size = soup(14, 20), (8, 8)
    before = keep(what, layout, size=size).works[0].total(ListEvent["STORE_TRANSACTIONS"])
    stores, seen, i = 2 * 8, [0] * 64, 0  # the tile itself: two surfaces, 8 rows
    for pixels in rounds_of(what, size):
        nodes = range(i, i + len(pixels))
        if layout == "fixed":
            nodes = []
            for p in pixels:
                nodes.append(64 * seen[p] + p)
                seen[p] += 1
        else:
            stores += sectors([4 * node for node in nodes], 4)
        stores += sectors([8 * node for node in nodes], 8)
        i += len(pixels)
    assert before == stores


def walked(what, size, layout):
    """Steps, moves and loads of the two warps of one tile, in lockstep, by the contents of their lists."""
    lists, node = [[] for _ in range(64)], 0
    by_triangle = {}
    for (y, x), entries in naive.fragments(*what, size).items():
        for _, depth, t in entries:
            by_triangle.setdefault(t, []).append((8 * y + 7 - x, depth))
    for t in sorted(by_triangle):
        for p, depth in sorted(by_triangle[t]):
            lists[p].append((depth, 64 * len(lists[p]) + p if layout == "fixed" else node))
            node += 1
    steps = moves = moved = loads = 0
    for warp in (lists[:32], lists[32:]):
        ordered = [entries if layout == "fixed" else entries[::-1] for entries in warp]
        kept = [[] for _ in warp]
        for i in range(max(map(len, ordered))):
            now = [(lane, entries[i]) for lane, entries in enumerate(ordered) if i < len(entries)]
            most = 0
            for lane, (depth, _) in now:
                nearer = [z for z in kept[lane] if z < depth or (z == depth and layout != "fixed")]
                kept[lane].append(depth)
                most, moved = max(most, len(nearer)), moved + len(nearer)
            steps, moves = steps + 1, moves + most
            loads += sectors([8 * at for _, (_, at) in now], 8)
            loads += 0 if layout == "fixed" else sectors([4 * at for _, (_, at) in now], 4)
    return steps, moves, moved, loads


@pytest.mark.parametrize("layout", LAYOUTS)
def test_steps_moves_and_loads_are_those_of_lockstep(layout):
    what, size = soup(15, 24), (8, 8)
    work = draw(what, layout, size=size)[2]
    steps, moves, moved, loads = walked(what, size, layout)
    E = ResolveEvent
    assert [work.total(e) for e in (E.LIST_STEPS, E.SORT_STEPS, E.SORT_LANES)] == [steps, moves, moved]
    assert work.total(E.LIST_LANES) == sum(map(len, naive.fragments(*what, size).values()))
    heads = 64 * 4 // 32
    assert work.total(E.LOAD_TRANSACTIONS) == loads + heads
    assert work.total(E.STORE_TRANSACTIONS) == heads


@pytest.mark.parametrize("layout", LAYOUTS)
def test_memory_is_nodes_and_heads(layout):
    what, size = soup(16, 20), (16, 8)
    fragments = sum(map(len, naive.fragments(*what, size).values()))
    facts = keep(what, layout, size=size).facts
    tiles = [sum(len(e) for (_, x), e in naive.fragments(*what, size).items() if x // 8 == t) for t in (0, 1)]
    nodes = {"chunked": sum(-(-n // 5) * 5 for n in tiles), "fixed": 128 * 40}.get(layout, fragments)
    assert facts["list_bytes"] == nodes * (8 if layout == "fixed" else 12) + 4 * 128
    assert facts["list_share"] == facts["list_bytes"] / (8 * 128)


def frame(machine="gtx480", **options):
    positions, triangles, colors = soup(9, 200)
    mesh = Mesh(positions.astype(np.float32), triangles.astype(np.int32), colors, clip_space=True)
    options = {"mode": "blend", "cull_backfaces": False, "lists": "linked"} | options
    return simulate(Scene("soup", mesh=mesh), "cudaraster", machine, width=64, height=64, **options)


@pytest.mark.parametrize("machine", ["gtx480", "h200"])
def test_fewer_atomics_take_less_time(machine):
    times = [frame(machine, lists=layout, room=512).stages.milliseconds["fine_raster"] for layout in LAYOUTS[:3]]
    assert times[0] > times[1] > times[2]


def test_a_frame_says_what_found_no_room():
    made = frame(lists="fixed", room=3)
    lost = made.frame.facts["fragments_lost"]
    assert f"{lost:,} fragments found no room" in made.frame.warnings[0]


@pytest.mark.parametrize(
    "options", [{"mode": "depth"}, {"msaa": 2}, {"batches": 2}, {"blend": "max"}, {"lists": "tree"}, {"room": 0}]
)
def test_what_lists_do_not_go_with(options):
    with pytest.raises(TilestampError):
        frame(**options)
