"""Tables on a narrow terminal: nothing is cut off."""

from functools import partial

import pytest
from rich.console import Console

from tilestamp.experiments.commands import terminal

WIDTH = 40
COLUMNS = ["stage", *(f"column_{i}" for i in range(7))]
ROWS = [["bound_and_split", *(f"{i}23,456" for i in range(7))], ["dice", *(f"{i}65,432" for i in range(7))]]


@pytest.fixture
def lines(monkeypatch, capsys):
    """Lines that a narrow terminal shows of what a function prints."""
    narrow = partial(Console, force_terminal=True, width=WIDTH, color_system=None)
    monkeypatch.setattr(terminal, "Console", narrow)

    def shown(function, *arguments, **keywords):
        function(*arguments, **keywords)
        return capsys.readouterr().out.splitlines()

    return shown


def test_every_cell_of_a_wide_table_is_whole(lines):
    words = " ".join(lines(terminal.print_table, "title", COLUMNS, ROWS)).split()
    assert {*COLUMNS, *ROWS[0], *ROWS[1]} <= set(words)


def test_no_line_of_a_wide_table_is_longer_than_the_terminal(lines):
    assert max(map(len, lines(terminal.print_table, "title", COLUMNS, ROWS))) <= WIDTH


def test_each_part_repeats_the_key_columns(lines):
    rows = [["total", "1 spp", *["12345678"] * 6]]
    said = lines(terminal.print_table, "title", ["row", "column", *"abcdef"], rows, keys=2)
    assert [line.split()[:3] for line in said if "12345678" in line] == [["total", "1", "spp"]] * 3


def test_a_table_that_fits_exactly_is_one_part(lines):
    said = lines(terminal.print_table, "title", ["a", "b", "c"], [["x" * 10, "y" * 13, "z" * (WIDTH - 27)]])
    assert len(said) == 3


def test_a_column_wider_than_the_terminal_goes_on_below(lines):
    said = " ".join(lines(terminal.print_table, "title", ["stage", "why"], [["dice", "bounds are low " * 10]]))
    assert said.count("bounds") == 10


def test_a_long_sentence_goes_on_below_itself(lines):
    said = lines(terminal.print_entries, {"killeroo": "a model that is not here, so put it on the path"})
    assert all(line.startswith(" " * len("killeroo")) for line in said[1:])
    assert len(said) > 1
