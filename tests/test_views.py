"""What a notebook shows of runs, studies and answers: a line, a card, and plots whose axes are given back."""

from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from tilestamp import Study, TilestampError, load_scene, simulate
from tilestamp.experiments.questions import answers
from tilestamp.reports.card import LARGEST, CardTable, card

TIMES = ("stages", "terms", "timeline")


@pytest.fixture(scope="module")
def run():
    return simulate("teapot", machine="gtx280", width=160, height=120)


@pytest.fixture(scope="module")
def study():
    fixed = {"scene": "teapot", "size": "64x48", "machine": "gtx280"}
    design = Study(title="tiles", fixed=fixed, grid={"tile": [4, 8], "times.sm.clock_mhz": [0.5, 1.0, 2.0]})
    design.run(jobs=1)
    return design


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


class Parsed(HTMLParser):
    """Tags of a card and the text of its cells; an element that is not closed is an error."""

    def __init__(self, html):
        super().__init__()
        self.open, self.tags, self.texts = [], [], []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):  # noqa: D102
        self.tags.append((tag, dict(attrs)))
        if tag not in ("img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):  # noqa: D102
        assert self.open.pop() == tag

    def handle_data(self, data):  # noqa: D102
        self.texts.append(data)

    def count(self, tag):
        """How many elements of a kind there are."""
        return sum(name == tag for name, _ in self.tags)


def test_the_line_of_a_run_says_what_on_what_and_how_long(run):
    assert repr(run) == f"<Run: teapot by micropolygon on gtx280, 160x120: {run.milliseconds:.4g} ms>"


@pytest.mark.parametrize(
    ("given", "told"), [({"counting": False}, "nothing was counted"), ({"fidelity": "counts"}, "counted, not priced")]
)
def test_a_run_without_times_says_so_and_has_no_plot_of_them(given, told):
    run = simulate("teapot", machine="gtx280", width=64, height=48, **given)
    assert repr(run).endswith(f"{told}>")
    assert told in run._repr_html_()
    for kind in TIMES:
        with pytest.raises(TilestampError, match="shows times, and this run has none"):
            run.plot(kind)


def test_a_run_that_no_mix_prices_says_why_instead_of_failing(run):
    other = simulate("teapot", "micropolygon", "gtx480", width=64, height=48)
    object.__setattr__(other, "pipeline", "freepipe")  # whose mix knows no such stage
    assert "no time (" in repr(other)


def test_runs_compare_without_an_error_and_a_run_is_itself_only(run):
    again = run.on("gtx280")
    assert run == run  # noqa: PLR0124
    assert run != again
    assert run.frame.works[0] != simulate("teapot", machine="gtx280", width=160, height=120).frame.works[0]
    assert run.launches != simulate("teapot", machine="gtx280", width=160, height=120).launches
    assert len({run, again}) == 2


def test_scenes_compare_without_an_error():
    assert load_scene("teapot") != load_scene("spot")


def test_a_card_has_the_picture_and_a_row_for_each_stage_in_both_tables(run):
    html = Parsed(run._repr_html_())
    assert html.count("img") == 1
    assert html.count("tbody") == 2
    assert html.count("tr") == 2 * (1 + len(run.stages))
    assert f"{run.stages['milliseconds']['tile_raster']:.4g}" in html.texts


def test_the_limit_that_takes_nearly_all_of_a_stage_is_coloured_most(run):
    html = Parsed(run._repr_html_())
    strengths = [float(attrs["style"].rpartition(",")[2].strip(" )")) for _, attrs in html.tags if "style" in attrs]
    terms = run.stages.filter(regex="_ms$").fillna(0.0).to_numpy() / run.stages["milliseconds"].to_numpy()[:, None]
    assert max(strengths) == pytest.approx(0.5 * min(1.0, terms.max()), abs=0.01)


def test_a_card_escapes_what_it_is_told():
    html = card("<b>", [CardTable("<i>", ["<u>"], [["<s>"]])], ["<em>"], np.zeros((4, 4, 3), np.uint8), alt='"<q>')
    assert not {"b", "i", "u", "s", "em", "q"} & {tag for tag, _ in Parsed(html).tags}


def test_the_picture_of_a_card_is_small():
    from base64 import b64decode
    from io import BytesIO

    from PIL import Image

    html = Parsed(card("", [], picture=np.zeros((1000, 2000, 3), np.uint8)))
    source = next(attrs["src"] for tag, attrs in html.tags if tag == "img")
    assert Image.open(BytesIO(b64decode(source.partition(",")[2]))).size == (LARGEST, LARGEST // 2)


@pytest.mark.parametrize("kind", [*TIMES, "map"])
def test_each_plot_gives_axes_of_a_figure_that_stays_open(run, kind):
    axes = run.plot(kind)
    assert axes.figure.number in plt.get_fignums()


@pytest.mark.parametrize("kind", [*TIMES, "map"])
def test_each_plot_draws_on_axes_that_are_given(run, kind):
    axes = Figure().subplots()
    assert run.plot(kind, axes=axes) is axes
    assert axes.has_data()
    assert "teapot" in axes.get_title(loc="left")


def test_the_bars_are_the_times_of_the_stages(run):
    widths = [bar.get_width() for bar in run.plot("stages").patches]
    assert widths == run.stages["milliseconds"].tolist()


def test_the_matrix_is_each_term_over_its_stages_time(run):
    shown = run.plot("terms").images[0].get_array()
    stage, term = list(run.stages.index).index("tile_raster"), 0
    row = run.stages.loc["tile_raster"]
    assert shown[stage, term] == pytest.approx(row["issue_ms"] / row["milliseconds"])


def test_a_map_is_that_of_the_counter(run):
    assert np.array_equal(run.plot("map", counter="tests").images[0].get_array(), run.frame.maps["tests"])


def test_another_plot_or_counter_is_one_sentence(run):
    with pytest.raises(TilestampError, match=r"no plot 'stage' .did you mean 'stages'"):
        run.plot("stage")
    with pytest.raises(TilestampError, match="draws no map of nothing; it has"):
        run.plot("map", counter="nothing")
    with pytest.raises(TilestampError, match="only numbers were asked for"):
        simulate("teapot", machine="gtx280", width=64, height=48, picture=False).plot("map")


def test_a_plot_into_a_file_leaves_no_figure_open(run, tmp_path):
    from tilestamp.simulator.run_views import draw

    before = plt.get_fignums()
    draw(run, "stages", tmp_path / "stages.png")
    assert (tmp_path / "stages.png").stat().st_size > 1000
    assert plt.get_fignums() == before


def test_the_line_of_a_study_has_its_cells_and_axes(study):
    assert repr(study) == "<Study: tiles: 6 cells over tile (2), times.sm.clock_mhz (3)>"


def test_the_line_of_a_study_that_is_wrong_says_why():
    assert "nonsense" in repr(Study(grid={"nonsense": [1, 2]}))


def test_the_card_of_a_study_has_its_rows(study):
    assert Parsed(study._repr_html_()).count("tr") == 1 + 6
    assert "nothing is stored" in Study(fixed={"scene": "teapot"}, grid={"tile": [4, 8]})._repr_html_()


def test_the_card_of_a_study_that_is_wrong_says_why():
    assert "a study needs a scene" in Study(grid={"tile": [4, 8]})._repr_html_()


def test_lines_of_a_study_are_its_table(study):
    axes = study.plot("lines", x="times.sm.clock_mhz")
    table = study.table()
    assert [line.get_ydata().tolist() for line in axes.lines] == [
        table[table["tile"] == tile]["milliseconds"].tolist() for tile in (4, 8)
    ]


def test_a_map_of_a_study_is_its_table(study):
    found = study.plot("map").collections[0].get_array()
    assert sorted(np.ravel(found)) == sorted(study.table()["milliseconds"])


def test_what_a_study_cannot_draw_is_one_sentence(study):
    with pytest.raises(TilestampError, match="no plot 'bars'; it has lines, map"):
        study.plot("bars")
    with pytest.raises(TilestampError, match="has no area: record it"):
        study.plot(number="area")
    with pytest.raises(TilestampError, match="no axis zoom"):
        study.plot(x="zoom")
    with pytest.raises(TilestampError, match="run\\(\\) it first"):
        Study(fixed={"scene": "teapot"}, grid={"tile": [4, 8]}).plot()


def test_an_answer_is_a_card_and_a_plot(study):
    answer = answers.front(study, "milliseconds", "tile")
    assert answer.sentences[0] in answer._repr_html_()
    assert answer.plot().has_data()
