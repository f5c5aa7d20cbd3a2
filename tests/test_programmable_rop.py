"""Programs of the ROP: pictures in input order, and what their conflicts and their words cost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_blend as naive
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.laine2011.blend_programs import BUILT_IN, BlendProgram, blend, random_word
from tilestamp.simulator.stages.laine2011.fine_raster import fine_raster
from tilestamp.simulator.stages.laine2011.programmable_rop import ProgramEvent, programmable_rop

SIZE = (19, 13)
E = ProgramEvent


def soup(seed, count=20):
    """Triangles of random colours, depths and alphas, many over each pixel."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1.2, 1.2, (3 * count, 4)) * [1, 1, 0.6, 0] + [0, 0, 0, 1]
    return positions, np.arange(3 * count).reshape(-1, 3), rng.uniform(0, 1, (3 * count, 4)).astype(np.float32)


def draw(what, program, layers=4, size=SIZE):
    positions, triangles, colors = what
    setup, lists = naive.prepared(positions, triangles, size)
    return programmable_rop(setup, *lists, *size, Simt(), program=program, layers=layers, colors=colors)


def picture(what, program, layers=4, size=SIZE):
    return draw(what, program, layers, size).outputs.color[0, : size[1], : size[0]]


def expected(what, program, size=SIZE):
    made = np.zeros((size[1], size[0]), np.uint32)
    for place, entries in naive.fragments(*what, size).items():
        made[place] = program(entries)
    return made


PLAIN = {"over": naive.over, "additive": naive.additive, "max": naive.largest, "multiply": naive.multiply}


@pytest.mark.parametrize("name", PLAIN)
def test_a_program_blends_fragments_in_input_order(name):
    what = soup(1)
    assert np.array_equal(picture(what, name), expected(what, lambda entries: naive.folded(PLAIN[name], entries)))


@given(st.sampled_from(list(PLAIN)), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
@settings(max_examples=200, derandomize=True, deadline=None)
def test_bytes_are_rounded_to_nearest(name, source, target):
    pixel = np.array([target], np.int64)
    blend(pixel, BUILT_IN.index(name), source, 0, 0)
    assert pixel[0] == PLAIN[name](source, target)


def test_over_as_a_program_is_the_mode_blend():
    what = soup(2, 60)
    setup, lists = naive.prepared(what[0], what[1], SIZE)
    plain = fine_raster(setup, *lists, *SIZE, Simt(), release="1.1", mode="blend", colors=what[2])
    assert np.array_equal(draw(what, "over").outputs.color, plain.outputs.color)


def test_nearest_as_a_program_is_the_depth_test():
    what = soup(3, 60)
    setup, lists = naive.prepared(what[0], what[1], SIZE)
    tested = fine_raster(setup, *lists, *SIZE, Simt(), release="1.1", mode="depth", colors=what[2])
    assert np.array_equal(draw(what, "nearest").outputs.color, tested.outputs.color)


@given(st.integers(0, 10**6), st.integers(1, 5))
@settings(max_examples=8, derandomize=True, deadline=None)
def test_a_k_buffer_keeps_the_nearest_and_blends_what_falls_out(seed, k):
    what = soup(seed, 9)
    assert np.array_equal(picture(what, "k-buffer", k), expected(what, lambda entries: naive.k_buffer(entries, k)))


def test_a_k_buffer_as_deep_as_the_scene_blends_in_order_of_depth():
    what = soup(4, 12)
    in_order = expected(what, lambda entries: naive.folded(naive.over, sorted(entries, key=lambda e: -e[1])))
    assert np.array_equal(picture(what, "k-buffer", 12), in_order)


def test_of_equal_depths_a_k_buffer_has_the_later_in_front():
    positions, triangles, _, size = layer(1.0, (8, 8))
    colors = np.repeat([[1, 0, 0, 1], [0, 1, 0, 0.5]], 3, axis=0).astype(np.float32)
    twice = np.tile(positions, (2, 1)), [*triangles, [3, 4, 5]], colors
    assert np.array_equal(picture(twice, "k-buffer", 4, size), picture(twice, "over", 4, size))


def layer(alpha, size):
    return (
        [[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]],
        [[0, 1, 2]],
        np.array([[1, 1, 1, alpha]] * 3, np.float32),
        size,
    )


@pytest.mark.parametrize("samples", [1, 4, 16])
@pytest.mark.parametrize("alpha", [51, 128, 230])
def test_of_one_layer_stochastic_transparency_has_the_published_variance(alpha, samples):
    *what, size = layer(alpha / 255, (128, 128))
    red = (picture(what, "stochastic", samples, size) & 255) / 255
    a, pixels = alpha / 255, size[0] * size[1]
    variance = a * (1 - a) / samples
    assert abs(red.mean() - a) < 4 * np.sqrt(variance / pixels) + 1e-4
    assert abs(red.var() / variance - 1) < 4 * np.sqrt(2 / pixels) + 0.03  # bytes, and a few samples, are coarse


def test_opaque_fragments_cover_all_samples_and_transparent_ones_none():
    *what, size = layer(1.0, (16, 16))
    assert set(picture(what, "stochastic", 3, size).ravel()) == {0xFFFFFFFF}
    *what, size = layer(0.0, (16, 16))
    assert not picture(what, "stochastic", 3, size).any()


def test_random_words_are_even_in_every_bit():
    words = np.array([random_word(key) for key in range(4096)])
    for bit in range(32):
        assert abs(((words >> bit) & 1).mean() - 0.5) < 0.04


def test_steps_are_those_of_the_busiest_pixel_of_each_round():
    what = soup(5, 40)
    size = (8, 8)  # one tile, so that fragments in input order make the rounds
    work = draw(what, "k-buffer", 3, size).works[0]
    places = [(t, y, 7 - x) for (y, x), entries in naive.fragments(*what, size).items() for _, _, t in entries]
    order = [place for _, *place in sorted(places)]
    rounds = [order[i : i + 32] for i in range(0, len(order), 32)]
    steps = sum(max(one.count(place) for place in one) for one in rounds)
    assert work.total(E.ROP_STEPS) == steps > len(rounds)
    assert work.total(E.ROP_LANES) == len(order)
    assert work.total(E.LAYER_STEPS) == 3 * steps
    assert work.total(E.RESOLVE_LAYERS) == 2 * 3


def test_a_program_that_reads_depths_loads_a_plane_for_each_triangle_of_a_round():
    what, size = soup(5, 40), (8, 8)
    places = [(t, y, 7 - x) for (y, x), entries in naive.fragments(*what, size).items() for _, _, t in entries]
    drawn = [t for t, *_ in sorted(places)]
    planes = sum(len(set(drawn[i : i + 32])) for i in range(0, len(drawn), 32))
    programs = BlendProgram(screen), "max"  # both of one word, and so of 20 warps
    reads, reads_not = (draw(what, program, size=size).works[0].total(E.LOAD_TRANSACTIONS) for program in programs)
    assert reads - reads_not == planes


def test_setup_makes_depths_only_for_programs_that_read_them():
    setup = {name: frame(name).stages.loc["triangle_setup"].instructions for name in ("max", "nearest", "k-buffer")}
    assert setup["max"] < setup["nearest"] == setup["k-buffer"]


@pytest.mark.parametrize(("program", "layers", "warps"), [("over", 4, 20), ("k-buffer", 4, 10), ("k-buffer", 16, 4)])
def test_words_leave_room_for_fewer_warps(program, layers, warps):
    work = draw(soup(6, 3), program, layers).works[0]
    assert work.block == 32 * warps
    assert work.shared_bytes <= 48 * 1024


def screen(pixel, color, _depth, _key):
    """Inverse product of the inverses, channel by channel."""
    result = 0
    for shift in (0, 8, 16, 24):
        s, d = (color >> shift) & 255, (pixel[0] >> shift) & 255
        result |= (255 - (255 - s) * (255 - d) // 255) << shift
    pixel[0] = result


def count_layers(pixel, _color, _depth, _key):
    """Keep the number of fragments in a word of its own, and show it."""
    pixel[1] += 1
    pixel[0] = pixel[1]


def test_a_function_of_the_user_is_a_program():
    what = soup(7)

    def one(source, target):
        pixel = [target]
        screen(pixel, source, 0, 0)
        return pixel[0]

    made = picture(what, f"{__name__}:screen")
    assert np.array_equal(made, expected(what, lambda entries: naive.folded(one, entries)))


def test_a_program_of_the_user_has_words_of_its_own():
    what = soup(8)
    made = picture(what, BlendProgram(count_layers, words=2))
    assert np.array_equal(made, expected(what, len))


def takes_three(pixel, color, _depth):
    pixel[0] = color


@pytest.mark.parametrize(("program", "words"), [(takes_three, 1), (count_layers, 1)])
def test_a_function_that_is_no_program_is_refused_in_one_sentence(program, words):
    with pytest.raises(TilestampError, match=f"blend {program.__name__}: .* {words} words a pixel; this is none"):
        picture(soup(7), BlendProgram(program, words=words))


def frame(blend, machine="gtx480", **options):
    positions, triangles, colors = soup(9, 200)
    mesh = Mesh(positions.astype(np.float32), triangles.astype(np.int32), colors, clip_space=True)
    options = {"mode": "blend", "cull_backfaces": False} | options
    return simulate(Scene("soup", mesh=mesh), "cudaraster", machine, width=64, height=64, blend=blend, **options)


slow_screen = BlendProgram(screen, operations={"int32": 4000.0})


def test_instructions_of_the_users_function_are_priced():
    plain, slow = frame(f"{__name__}:screen"), frame(f"{__name__}:slow_screen")
    steps = slow.counts["fine_raster.ROP_STEPS"]
    assert slow.counts["fine_raster.INT32"] == 4000 * steps
    assert np.array_equal(plain.image, slow.image)
    assert slow.milliseconds > plain.milliseconds


@pytest.mark.parametrize("machine", ["gtx480", "h200"])
@pytest.mark.parametrize("program", ["k-buffer", "stochastic"])
def test_more_layers_cost_more(machine, program):
    few, many = (frame(program, machine, layers=k).stages.loc["fine_raster"] for k in (14, 16))  # of 4 warps each
    assert many.instructions > few.instructions
    assert many.milliseconds > few.milliseconds


def test_lanes_on_one_pixel_take_turns_and_lanes_apart_do_not():
    def dots(places):
        x, y = np.asarray(places).T[..., None] + np.array([[0.2, 0.9, 0.2], [0.2, 0.2, 0.9]])[:, None]
        corners = np.stack([x / 4 - 1, y / 4 - 1, 0 * x, 0 * x + 1], axis=-1).reshape(-1, 4)
        return corners, np.arange(len(corners)).reshape(-1, 3), np.ones((len(corners), 4), np.float32)

    together, apart = ([(3, 3)] * 32, [(i % 8, i // 8) for i in range(32)])
    steps = [draw(dots(places), "over", size=(8, 8)).works[0].total(E.ROP_STEPS) for places in (together, apart)]
    assert steps == [32, 1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"blend": "screen"}, "MODULE:NAME"),
        ({"blend": "nowhere:screen"}, "nowhere"),
        ({"blend": "max", "mode": "depth"}, "alone have them"),
        ({"blend": "max", "msaa": 4}, "alone have them"),
        ({"blend": "max", "batches": 2}, "alone have them"),
    ],
)
def test_what_it_does_not_take(options, said):
    with pytest.raises(TilestampError, match=said):
        frame(**options)
