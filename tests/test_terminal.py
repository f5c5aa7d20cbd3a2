"""What the commands print on a terminal: tables of which nothing is cut off, and progress."""

from functools import partial
from io import StringIO

import pytest
from rich.console import Console

from tilestamp.experiments.commands import tables, terminal
from tilestamp.models.compile_cache import note_compiled, note_compiling

WIDTH = 40
COLUMNS = ["stage", *(f"column_{i}" for i in range(7))]
ROWS = [["bound_and_split", *(f"{i}23,456" for i in range(7))], ["dice", *(f"{i}65,432" for i in range(7))]]


@pytest.fixture
def lines(monkeypatch, capsys):
    """Lines that a narrow terminal shows of what a function prints."""
    narrow = partial(Console, force_terminal=True, width=WIDTH, color_system=None)
    monkeypatch.setattr("rich.console.Console", narrow)

    def shown(function, *arguments, **keywords):
        function(*arguments, **keywords)
        return capsys.readouterr().out.splitlines()

    return shown


def test_every_cell_of_a_wide_table_is_whole(lines):
    words = " ".join(lines(tables.print_table, "title", COLUMNS, ROWS)).split()
    assert {*COLUMNS, *ROWS[0], *ROWS[1]} <= set(words)


def test_no_line_of_a_wide_table_is_longer_than_the_terminal(lines):
    assert max(map(len, lines(tables.print_table, "title", COLUMNS, ROWS))) <= WIDTH


def test_each_part_repeats_the_key_columns(lines):
    rows = [["total", "1 spp", *["12345678"] * 6]]
    said = lines(tables.print_table, "title", ["row", "column", *"abcdef"], rows, keys=2)
    assert [line.split()[:3] for line in said if "12345678" in line] == [["total", "1", "spp"]] * 3


def test_of_keys_that_would_leave_no_room_only_the_first_is_repeated(lines):
    said = lines(tables.print_table, "title", ["a" * 15, "b" * 15, *"cdef"], [["x", "y", *["12345678"] * 4]], keys=2)
    assert len([line for line in said if line.startswith("x")]) > 1
    assert sum("y" in line for line in said) == 1


def test_a_table_that_fits_exactly_is_one_part(lines):
    said = lines(tables.print_table, "title", ["a", "b", "c"], [["x" * 10, "y" * 13, "z" * (WIDTH - 27)]])
    assert len(said) == 3


def test_a_column_wider_than_the_terminal_goes_on_below(lines):
    said = " ".join(lines(tables.print_table, "title", ["stage", "why"], [["dice", "bounds are low " * 10]]))
    assert said.count("bounds") == 10


def test_columns_that_belong_together_stay_in_one_part(lines):
    columns, row = ["stage", *["ms", "share", "ratio"] * 4], ["dice", *(f"{i}23456" for i in range(12))]
    said = lines(tables.print_table, "title", columns, [row], together=3)
    assert [line.split()[1:] for line in said if "ms" in line] == [["ms", "share", "ratio"]] * 4


def test_only_the_first_columns_and_what_fits_beside_them_are_printed_where_that_is_asked_for(lines):
    said = lines(tables.print_table, "title", COLUMNS, ROWS, first=1)
    assert said[1].split() == COLUMNS[:3]


def test_the_first_columns_are_printed_below_each_other_where_they_do_not_fit(lines):
    said = " ".join(lines(tables.print_table, "title", COLUMNS, ROWS, first=4)).split()
    assert {*COLUMNS[:5]} <= {*said}
    assert COLUMNS[5] not in said


def test_columns_that_were_left_out_are_named(lines):
    left = []
    lines(lambda: left.extend(tables.print_table("title", COLUMNS, ROWS, first=1)))
    assert left == COLUMNS[3:]


def test_what_looks_like_markup_is_printed_as_it_is(lines):
    assert "[red]a" in " ".join(lines(tables.print_table, "title", ["a", "b"], [["x", "[red]a"]]))


def test_a_file_has_each_table_whole(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    tables.print_table("title", COLUMNS, ROWS)
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_the_environment_says_how_wide_a_file_is(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    tables.print_table("title", COLUMNS, ROWS)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= WIDTH


def test_a_long_sentence_goes_on_below_itself(lines):
    said = lines(tables.print_entries, {"killeroo": "a model that is not here, so put it on the path"})
    assert all(line.startswith(" " * len("killeroo")) for line in said[1:])
    assert len(said) > 1


def _terminal(*, tty):
    console = Console(file=StringIO(), force_terminal=tty, width=200, color_system=None)
    return console, terminal.Progress(console, console.status("drawing"), "drawing")


def test_progress_is_silent_where_there_is_no_terminal():
    console, say = _terminal(tty=False)
    say("pricing")
    say.count(1, 3)
    assert console.file.getvalue() == ""


def test_compiling_is_said_once_for_each_thing_where_there_is_no_terminal():
    console, say = _terminal(tty=False)
    for text in ("one", "two"):
        say(text)
        for kernel in ("a", "b", ""):
            say.compiling(kernel)
    said = console.file.getvalue().splitlines()
    assert said == [f"{text}: compiling kernels (first run only)" for text in ("one", "two")]


def test_a_terminal_shows_what_is_compiled_now_and_how_many_are_done(monkeypatch):
    shown = []
    _, say = _terminal(tty=True)
    monkeypatch.setattr(say._status, "update", lambda text: shown.append(str(text)))
    say.count(0, 2)
    say.compiling("stage.kernel")
    say.compiling("")
    assert shown == ["0 of 2: drawing", "0 of 2: drawing: compiling stage.kernel (first run only)", "0 of 2: drawing"]


def test_nothing_is_said_after_the_end(capsys):
    with terminal.progress("drawing"):
        pass
    note_compiling(_terminal)
    note_compiled()
    assert capsys.readouterr().err == ""


def test_long_sentences_beside_wide_cells_stand_below_them_on_a_narrow_terminal(lines):
    said = lines(
        tables.print_words, [["sm.count", "132", "measured by a very long sentence"]], ["number", "value", "source"]
    )
    assert said == ["sm.count  132", "    measured by a very long sentence"]
