"""Mixes: events priced in machine events."""

from enum import IntEnum

import numpy as np
import pytest

from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.models.events import MachineEvent
from tilestamp.models.launch import Stream
from tilestamp.models.machine import load_machine
from tilestamp.models.traffic import traffic
from tilestamp.simulator import mix as mix_module
from tilestamp.simulator.mix import MIXES, PROVENANCES, KernelMix, Mix, load_mix
from tilestamp.simulator.work import Work

pytestmark = pytest.mark.small


class Event(IntEnum):
    """Events of a made-up kernel."""

    STEPS = 0
    STEP_LANES = 1
    LOAD_TRANSACTIONS = 2


def kernel(**prices: dict[str, object]) -> KernelMix:
    return KernelMix("k", 16, 0, prices, {})


def test_an_event_costs_its_instructions():
    matrix = kernel(STEPS={"fp32": 3, "load": 1}).matrix(Event, 32)
    assert matrix[Event.STEPS, MachineEvent.FP32] == 3
    assert matrix[Event.STEPS, MachineEvent.LOAD] == 1


def test_lanes_are_instructions_times_the_event_that_counts_lanes():
    matrix = kernel(STEPS={"fp32": 3, "load": 1, "lanes": "STEP_LANES"}).matrix(Event, 32)
    assert matrix[Event.STEP_LANES, MachineEvent.LANES] == 4
    assert matrix[Event.STEPS, MachineEvent.LANES] == 0


def test_without_lanes_whole_warps_are_active():
    assert kernel(STEPS={"int32": 2}).matrix(Event, 32)[Event.STEPS, MachineEvent.LANES] == 64


def test_an_event_with_the_name_of_a_machine_event_passes_through():
    assert kernel().matrix(Event, 32)[Event.LOAD_TRANSACTIONS, MachineEvent.LOAD_TRANSACTIONS] == 1


def test_chain_steps_are_no_instructions():
    assert kernel(STEPS={"chain_load": 2}).matrix(Event, 32)[:, MachineEvent.LANES].sum() == 0


def test_a_price_for_an_event_that_is_not_counted_is_refused():
    with pytest.raises(TilestampError, match="NOTHING"):
        kernel(NOTHING={"fp32": 1}).matrix(Event, 32)


def test_lanes_that_are_not_counted_are_refused():
    with pytest.raises(TilestampError, match="GHOSTS"):
        kernel(STEPS={"fp32": 1, "lanes": "GHOSTS"}).matrix(Event, 32)


def test_a_kernel_without_a_mix_is_refused():
    work = Work("s", Event, np.zeros((1, 3), np.int64), 32, kernel="unknown", grid=1)
    with pytest.raises(TilestampError, match="unknown"):
        load_mix("micropolygon", "1.3").launch(work, 32)


def test_a_launch_has_the_works_shape_and_the_mixs_prices():
    mix = Mix("p/cc1", {"k": KernelMix("k", 21, 100, {"STEPS": {"fp32": 3, "shared": 2}}, {}, in_step=True)}, "")
    table = np.array([[1, 32, 5], [2, 40, 7]], np.int64)
    work = Work("s", Event, table, 64, kernel="k", grid=2, shared_bytes=16)
    launch = mix.launch(work, 32)
    assert (launch.registers, launch.shared_bytes, launch.grid, launch.block) == (21, 116, 2, 64)
    assert launch.in_step
    columns = [MachineEvent.FP32, MachineEvent.SHARED, MachineEvent.LANES, MachineEvent.LOAD_TRANSACTIONS]
    assert launch.events[:, columns].tolist() == [[3, 2, 5 * 32, 5], [6, 4, 10 * 32, 7]]


LOCAL_PRICES = {"STEPS": {"load_bytes": 256, "store_bytes": 128}}
LOCAL = Mix("p/cc1", {"k": KernelMix("k", 16, 0, LOCAL_PRICES, {}, uncached=True)}, "")
FIVE_STEPS = {"stage": "s", "kernel": "k", "events": Event, "table": np.array([[5, 160, 0]]), "grid": 1, "block": 32}


def test_local_memory_is_a_buffer_of_the_launch_where_l1_does_not_hold_it():
    own = Stream("points", "load", 64, 64)
    held = Mix("p/cc8", {"k": KernelMix("k", 16, 0, LOCAL_PRICES, {})}, "")
    assert held.launch(Work(**FIVE_STEPS, streams=(own,)), 32).streams == (own,)
    streams = LOCAL.launch(Work(**FIVE_STEPS, streams=(own,)), 32).streams
    assert streams == (own, Stream("k local", "store", 640, 640), Stream("k local", "load", 1280, 1280))


def test_local_memory_goes_to_dram_where_there_is_no_cache():
    launches = [LOCAL.launch(Work(**FIVE_STEPS, streams=s), 32) for s in ((), (Stream("points", "load", 64, 64),))]
    moved = [traffic([launch], load_machine("gtx280"))[0].dram_bytes for launch in launches]
    assert moved == [5 * 384, 5 * 384 + 64]


def test_a_variant_with_a_table_of_its_own_takes_that():
    kernels = {name: KernelMix(name, size, 0, {}, {}) for name, size in (("k", 10), ("k: tile 8", 20))}
    mix = Mix("p/cc1", kernels, "")
    work = {"stage": "s", "kernel": "k", "events": Event, "table": np.zeros((1, 3), np.int64), "grid": 1, "block": 32}
    registers = [mix.launch(Work(**work, variant=variant), 32).registers for variant in ("", "tile 8", "tile 4")]
    assert registers == [10, 20, 10]


LIKE = """
[k]
registers = 10
provenance = "derived"
source = "here"
STEPS = { fp32 = 3 }
LOADS = { load = 1 }
["k: fast"]
like = "k"
LOADS = {}
"""


def write_mix(folder, text):
    (folder / "p").mkdir()
    (folder / "p" / "cc1.toml").write_text(text, "utf-8")


def test_a_table_like_another_has_what_it_does_not_say(tmp_path, monkeypatch):
    write_mix(tmp_path, LIKE)
    monkeypatch.setattr(mix_module, "MIXES", tmp_path)
    load_mix.cache_clear()
    fast = load_mix("p", "1.0").kernels["k: fast"]
    load_mix.cache_clear()
    assert (fast.registers, fast.prices) == (10, {"STEPS": {"fp32": 3}, "LOADS": {}})
    assert fast.provenance["STEPS"] == ("derived", "here")


def test_a_table_like_one_that_is_not_there_is_refused(tmp_path, monkeypatch):
    write_mix(tmp_path, LIKE.replace('like = "k"', 'like = "ghost"'))
    monkeypatch.setattr(mix_module, "MIXES", tmp_path)
    with pytest.raises(TilestampError, match="like ghost"):
        load_mix("p", "1.0")


def test_an_event_of_instructions_that_passes_through_is_one_instruction_of_its_lanes():
    kind = IntEnum("kind", {"ATOMIC": 0, "ATOMIC_LANES": 1})
    matrix = kernel(ATOMIC={"int32": 2, "lanes": "ATOMIC_LANES"}).matrix(kind, 32)
    assert matrix[kind.ATOMIC, MachineEvent.ATOMIC] == 1
    assert matrix[kind.ATOMIC_LANES, MachineEvent.LANES] == 3


@pytest.mark.parametrize(("capability", "family"), [("1.3", "cc1"), ("3.0", "cc1"), ("8.6", "cc1"), ("9.0", "cc9")])
def test_the_newest_family_that_is_not_newer_is_taken(capability, family):
    assert load_mix("micropolygon", capability).name == f"micropolygon/{family}"


def test_a_kernel_that_a_file_has_no_table_for_is_that_of_the_older_file_which_it_names():
    new, old = load_mix("binned", "9.0"), load_mix("binned", "8.6")
    assert new.kernels["ROP_before"].prices == old.kernels["ROP_before"].prices
    assert new.kernels["ROP"].registers == 38
    assert new.digest != old.digest


def test_an_older_machine_takes_the_oldest_family():
    assert load_mix("micropolygon", "1.0").name == "micropolygon/cc1"


@pytest.mark.parametrize("path", sorted(MIXES.glob("*/cc*.toml")), ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_every_mix_says_where_each_number_comes_from(path):
    mix = load_mix(path.parent.name, path.stem.removeprefix("cc"))
    for kernel_mix in mix.kernels.values():
        for kind, source in kernel_mix.provenance.values():
            assert kind in PROVENANCES
            assert source


def test_more_samples_never_take_less_time_on_the_h200():
    """Sixteen samples have no machine code of their own; their price once fell to that of one."""
    runs = [simulate("teapot", machine="h200", width=160, height=120, spp=spp) for spp in (1, 4, 16)]
    times = [run.stages.loc["tile_raster", "milliseconds"] for run in runs]
    assert times == sorted(times)


@pytest.mark.parametrize(("machine", "words"), [("gtx280", 144), ("h200", 0)])
def test_the_oracles_arrays_lie_in_memory_on_1_x(machine, words):
    run = simulate("teapot", "micropolygon", machine=machine, width=80, height=60, picture=False)
    oracles = [k for k, work in enumerate(run.frame.works) if work.kernel == "oracle"]
    examined = sum(int(run.frame.works[k].counts()["EXAMINE_WARPS"]) for k in oracles)
    local = [s for k in oracles for s in run.launches[k].streams if s.buffer == "oracle local"]
    assert sum(s.bytes for s in local) == 2 * words * 128 * examined
