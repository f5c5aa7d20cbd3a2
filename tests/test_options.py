"""Options: one struct a pipeline for the library, the command line and files; what it does not take, it names."""

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drawable import scene_for
from tilestamp import TilestampError, simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.simulator.options import Options, descriptions, plain, takes
from tilestamp.simulator.pipelines import options_type, pipeline_names, pipeline_options

SMALL = ["--size", "64x48"]
FIELDS = [(name, field) for name in pipeline_names() for field in msgspec.structs.fields(options_type(name))]
IDS = [f"{name}-{field.name}" for name, field in FIELDS]
JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.binary(max_size=3),
    st.lists(st.integers(), max_size=3),
    st.tuples(st.floats(), st.integers()),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
    st.complex_numbers(),
    st.builds(object),
)


def options(pipeline, **given_options):
    return pipeline_options(pipeline, given_options)


@pytest.mark.parametrize("name", pipeline_names())
def test_defaults_are_what_the_struct_takes_and_round_trip_through_json(name):
    default = options(name)
    assert options(name, **json.loads(json.dumps(plain(default)))) == default


@pytest.mark.parametrize(("name", "field"), FIELDS, ids=IDS)
def test_every_option_says_what_it_is_and_what_it_takes(name, field):
    assert descriptions(options_type(name))[field.name].endswith((".", ")"))
    assert takes(field.type)


@pytest.mark.parametrize(("name", "field"), FIELDS, ids=IDS)
@settings(max_examples=25, deadline=None)
@given(value=JUNK)
def test_any_value_is_taken_as_the_type_says_or_refused_in_a_sentence_that_names_the_option(name, field, value):
    said, taken = "", value
    try:
        taken = getattr(options(name, **{field.name: value}), field.name)
    except TilestampError as error:
        said = str(error)
    assert not said or (said.startswith(field.name) and (takes(field.type) in said or "release" in said))
    assert value is None or np.array_equal(taken, value, equal_nan=False) or taken is value


@pytest.mark.parametrize(
    ("given_value", "kept"), [(np.int64(16), 16), (16.0, 16), (np.float32(16), 16), (np.uint8(16), 16), (16, 16)]
)
def test_whole_numbers_of_any_kind_are_whole_numbers(given_value, kept):
    tile = options("micropolygon", tile=given_value).tile
    assert (tile, type(tile)) == (kept, int)


def test_numpy_booleans_are_booleans_and_whole_numbers_are_not():
    assert options("micropolygon", hybrid=np.True_).hybrid is True
    with pytest.raises(TilestampError, match="hybrid takes true or false, not 1"):
        options("micropolygon", hybrid=1)
    with pytest.raises(TilestampError, match="spp takes 1, 4 or 16, not True"):
        options("micropolygon", spp=True)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300, 0, -1.0])
def test_a_length_is_a_number_that_a_kernel_can_take(value):
    with pytest.raises(TilestampError, match="bound takes a number over 0 to 4096"):
        options("micropolygon", bound=value)


@pytest.mark.parametrize("text", ["2 = [[0, 0]", b"\xd0\xff"])
def test_a_file_of_positions_that_is_none_is_named(text, tmp_path):
    path = tmp_path / "positions.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(TilestampError, match=r"positions\.toml"):
        simulate("teapot", "stamps", width=8, height=8, positions=path)


def test_a_texture_is_an_array_or_its_nested_lists():
    texture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    back = options("micropolygon", **plain(options("micropolygon", texture=texture)))
    assert np.array_equal(back.texture, texture)
    for wrong in ("brick", np.full((1, 1, 3), 0.5), [[[300, 0, 0]]], [[[0.5, 0, 0]]], [[[0, 1], [0]]]):
        with pytest.raises(TilestampError, match="texture takes an array or none, not"):
            options("micropolygon", texture=wrong)


def test_an_unknown_option_names_the_nearest_and_all():
    with pytest.raises(
        TilestampError, match=r"has no option tyle \(did you mean 'tile'\?\); it has cull_backfaces, perspective"
    ):
        options("tiled", tyle=8)


def test_a_run_has_all_options_with_their_defaults_resolved():
    run = simulate("teapot", "cudaraster", "gtx480", width=48, height=36, fidelity="bounds", msaa=np.int64(2))
    assert run.options == plain(options("cudaraster", msaa=2))
    assert (run.options["cull_backfaces"], run.options["msaa"]) == (True, 2)
    assert options("cudaraster", release="nvdiffrast").cull_backfaces is False


def test_strings_below_the_fields_are_found_in_parents_too():
    class Parent(Options, frozen=True, kw_only=True):
        """Some."""

        first: int = 1
        """The
        first."""
        silent: int = 2

    assert descriptions(Parent) == {"first": "The first."}
    assert {"spp", "packing"} <= descriptions(options_type("across-polygons")).keys()


@pytest.mark.parametrize("name", pipeline_names())
def test_options_are_listed(name, capsys):
    assert run_command(["list", "options", name, "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert list(listed) == list(options_type(name).__struct_fields__)
    assert all(option["takes"] and option["what"] and option["default"] for option in listed.values())


@pytest.mark.parametrize("name", pipeline_names())
def test_every_default_can_be_written_on_the_command_line(name, capsys):
    assert run_command(["list", "options", name, "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    written = [word for option, said in listed.items() for word in ("-O", f"{option}={said['default']}")]
    scene = [
        "render",
        scene_for(name),
        "--machine",
        "h200",
        "--pipeline",
        name,
        "--fidelity",
        "bounds",
        *SMALL,
        "--json",
    ]
    assert run_command([*scene, *written]) == 0
    assert json.loads(capsys.readouterr().out)["options"] == plain(options(name))


@pytest.mark.parametrize("name", pipeline_names())
def test_help_shows_every_option_in_80_columns(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert run_command(["render", "--pipeline", name, "--help"]) == 0
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 80
    for option in set(options_type(name).__struct_fields__) - {"texture", "relief"}:
        assert f"--{option.replace('_', '-')}" in shown
    assert "…" not in shown


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--tile", "8.5"], "tile takes 4, 8, 16 or 32, not 8.5"),
        (["-O", "hybrid=maybe"], "hybrid takes true or false, not 'maybe'"),
        (["--tile", "8", "-O", "tile=16"], "tile is given twice: 8 and 16"),
        (["-O", "tile=8", "-O", "tile=16"], "tile is given twice: 8 and 16"),
        (["--no-hybrid", "-O", "hybrid=true"], "hybrid is given twice: false and true"),
        (["--set", "sm.count=8", "--set", "sm.count=9"], "sm.count is given twice: 8 and 9"),
        (["--tile", "8", "--tile", "16"], "--tile"),
        (["-O", "tyle=8"], "did you mean 'tile'?"),
        (["--tyle", "8"], "--tile"),
        (["-O", "tile"], "write NAME=VALUE, not tile"),
        (["--pipeline", "cudaraster", "-O", "guard_band=foo"], "guard_band takes true, false or none, not 'foo'"),
        (["--pipeline", "stamps", "--stamp", "4,2,1"], "stamp takes a whole number from 1 to 1024 or 2 of them"),
    ],
)
def test_what_an_option_does_not_take_is_one_sentence_and_exit_code_2(arguments, sentence, capsys):
    assert run_command(["render", "teapot", *SMALL, *arguments]) == BAD_INPUT
    (said,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert said.startswith("tilestamp: ")
    assert sentence in said


@pytest.mark.parametrize(
    ("arguments", "option", "value"),
    [
        (["-O", "hybrid=false"], "hybrid", False),
        (["-O", "box-tests=FALSE"], "box_tests", False),
        (["--no-box-tests"], "box_tests", False),
        (["--tile", "16.0"], "tile", 16),
        (["--bound", "8"], "bound", 8.0),
        (["--pipeline", "freepipe", "--packing", "32"], "packing", "32"),
        (["--pipeline", "stamps", "--stamp", "4,2"], "stamp", [4, 2]),
    ],
)
def test_text_becomes_what_the_option_takes(arguments, option, value, capsys):
    assert run_command(["render", "teapot", *SMALL, "--json", "--fidelity", "counts", *arguments]) == 0
    assert json.loads(capsys.readouterr().out)["options"][option] == value


def test_list_alone_says_what_can_be_listed(capsys):
    assert run_command(["list"]) == BAD_INPUT
    assert "machines, experiments, options PIPELINE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "right"),
    [(["list", "options"], "list options PIPELINE"), (["list", "scenes", "tiled"], "list scenes")],
)
def test_a_name_goes_with_what_belongs_to_something(arguments, right, capsys):
    assert run_command(arguments) == BAD_INPUT
    assert f"write: tilestamp {right}\n" in capsys.readouterr().err
