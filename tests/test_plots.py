"""Plots: what is published is drawn, what lies on something else is said, and files say what they show."""

from itertools import pairwise

import pandas as pd
import pytest
from matplotlib.figure import Figure

from tilestamp.reports.bars import paired_bars, stacked_bars
from tilestamp.reports.methods_plot import panels
from tilestamp.reports.plots import lines
from tilestamp.reports.save import description

STEPS = [1.0, 10.0, 100.0]
LABELS = {"title": "A title", "x_label": "size [pixels]", "y_label": "time [ms]"}


def axes():
    return Figure().subplots()


def table(**series):
    return pd.concat(pd.DataFrame({"x": STEPS, "y": values, "by": name}) for name, values in series.items())


def legend(drawn):
    return [text.get_text() for text in drawn.get_legend().get_texts()]


def draw(data, **more):
    return lines(data, axes(), x="x", y="y", by="by", **LABELS, **more)


def test_lines_that_coincide_are_one_that_has_all_names():
    drawn = draw(table(a=[1, 2, 3], b=[9, 9, 9], c=[1, 2, 3]))
    assert legend(drawn) == ["a = c", "b"]
    assert len(drawn.lines) == 2


def test_lines_that_part_anywhere_are_drawn_apart():
    assert legend(draw(table(a=[1, 2, 3], b=[1, 2, 3.2]))) == ["a", "b"]


def test_on_a_logarithmic_axis_small_numbers_are_told_apart():
    parted = table(a=[1e-6, 1, 1], b=[1e-3, 1, 1])
    assert legend(draw(parted)) == ["a = b"]
    assert legend(draw(parted, log_y=True)) == ["a", "b"]


def test_a_line_that_is_zero_throughout_says_so():
    assert legend(draw(table(a=[0, 0, 0], b=[1, 2, 3]))) == ["a: 0 throughout", "b"]


def test_lines_with_published_points_stay_apart():
    data = table(a=[1, 2, 3], b=[1, 2, 3]).assign(known=[1, 2, 3, 4, 5, 6])
    drawn = draw(data, published="known")
    assert legend(drawn) == ["a", "b", "published"]
    assert [list(line.get_ydata()) for line in drawn.lines][1::2] == [[1, 2, 3], [4, 5, 6]]


def test_words_stand_beside_their_points():
    drawn = draw(table(a=[1, 2, 3]), said=[(10.0, 2.0, "as published")])
    assert [(text.get_text(), text.xy) for text in drawn.texts] == [("as published", (10.0, 2.0))]


@pytest.mark.parametrize("decades", [0.8, 1.2, 1.9, 2.5, 4.5, 9.0, 14.0])
def test_no_ticks_of_a_logarithmic_axis_overlap(decades, tmp_path):
    data = table(**{"a long name of a series that takes room": [4.0, 30.0, 700.0]})
    drawn = draw(data.assign(x=[1e-3, 1e-2, 1e-3 * 10**decades]), log_x=True)
    drawn.figure.set_size_inches(7.2, 4.4)
    drawn.figure.tight_layout()
    drawn.figure.savefig(tmp_path / "drawn.png")
    boxes = [tick.get_window_extent() for tick in drawn.get_xticklabels() if tick.get_text()]
    low, high = drawn.get_window_extent().x0, drawn.get_window_extent().x1
    shown = [box for box in boxes if low <= (box.x0 + box.x1) / 2 <= high]
    assert len(shown) > 1
    assert all(left.x1 < right.x0 for left, right in pairwise(shown))


def test_no_legend_lies_on_the_axes():
    drawn = draw(table(a=[1, 2, 3], b=[3, 2, 1]))
    drawn.figure.draw_without_rendering()
    assert drawn.get_legend().get_window_extent().x0 >= drawn.get_window_extent().x1


def test_bars_show_what_is_published_and_the_status():
    data = pd.DataFrame({"label": ["a", "b", "c"], "ours": [1.0, 2.0, 3.0], "known": [1.5, 2.5, 9.0]})
    data["status"] = ["predicted", "fitted", "stand-in"]
    drawn = paired_bars(data, axes(), title="T", unit="ms", known="known")
    assert list(drawn.lines[0].get_xdata()) == [1.5, 2.5, 9.0]
    assert len({patch.get_facecolor() for patch in drawn.patches}) == 3
    assert drawn.get_xlim()[1] > 9.0  # no bar and no point at the frame


def test_stacked_bars_have_the_published_ones_below_them():
    ours = pd.DataFrame({"one": [1.0, 2.0], "two": [3.0, 4.0]}, index=["a", "b"])
    known = pd.DataFrame({"two": [5.0], "all": [9.0]}, index=["b"])
    drawn = stacked_bars(ours, axes(), title="T", unit="ms", published=known)
    lengths = [[bar.get_width() for bar in bars] for bars in drawn.containers]
    assert lengths[:2] == [[1.0, 2.0], [3.0, 4.0]]
    assert lengths[2:4] == [[0.0, 5.0], [0.0, 9.0]]
    assert drawn.containers[3][1].get_x() == 5.0  # from where the part before it ends
    assert drawn.get_xlim()[1] > 14.0


def test_a_path_without_a_suffix_gives_pixels_and_vectors_that_say_what_they_show(tmp_path):
    lines(table(a=[1, 2, 3], b=[3, 2, 1]), tmp_path / "plot", x="x", y="y", by="by", **LABELS)
    said = description(tmp_path / "plot.png")
    assert said.startswith("A title. Up: time [ms], 0 to 3.1; across: size [pixels]")
    assert said.endswith("Shown: a, b.")
    assert said in (tmp_path / "plot.svg").read_text()


def test_a_path_with_a_suffix_gives_that_file_alone(tmp_path):
    lines(table(a=[1, 2, 3]), tmp_path / "plot.png", x="x", y="y", by="by", **LABELS)
    assert [path.name for path in tmp_path.iterdir()] == ["plot.png"]


def test_names_along_an_axis_are_said(tmp_path):
    stacked_bars(pd.DataFrame({"one": [1.0, 2.0]}, index=["bin", "fine"]), tmp_path / "plot", title="T", unit="ms")
    assert "Up: bin, fine; across: ms, 0 to 2.12." in description(tmp_path / "plot.png")


@pytest.mark.parametrize("fronts", [["front"], ["front", "soft"]])
def test_a_front_of_software_is_named_where_there_is_one(tmp_path, fronts):
    points = pd.DataFrame({"scene": "a", "method": "b", "ms": [1.0, 2.0], "error": [3.0, 1.0], "front": True})
    places = {"panel": "scene", "group": "method", "x": "ms", "y": "error"}
    panels(points.assign(soft=[False, True]), tmp_path / "front.svg", **places, fronts=fronts, **LABELS)
    assert ("<!-- front of software -->" in (tmp_path / "front.svg").read_text()) == (len(fronts) == 2)
