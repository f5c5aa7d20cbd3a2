"""The page: what of a folder of results is on it, and that it needs nothing else."""

import json
import re
from html.parser import HTMLParser

import pytest

from tests.page_results import paper, write_page_of_everything
from tilestamp.experiments.harness.folder import rebuild
from tilestamp.experiments.harness.write import Making, write_result
from tilestamp.reports.page_words import Glossary, error, number, percent

MEGABYTE = 1_000_000


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return write_page_of_everything(tmp_path_factory.mktemp("results"))


@pytest.fixture(scope="module")
def text(page):
    return page.read_text()


class Elements(HTMLParser):
    """All start tags, with their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        """Keep a tag."""
        self.found.append((tag, dict(attributes)))

    def all(self, tag):
        """Attributes of the tags of one name."""
        return [attributes for name, attributes in self.found if name == tag]


def tables_of(text, chart):
    """Tables that are in the page for a chart."""
    spec = json.loads(re.search(rf'id="spec-{chart}">(.*?)</script>', text, re.DOTALL)[1])
    return list(spec["datasets"].values())


def test_every_picture_and_file_of_the_page_lies_beside_it(page, text):
    elements = Elements(text)
    files = [image["src"] for image in elements.all("img")] + [a["href"] for a in elements.all("a")]
    beside = [file for file in files if not file.startswith("#")]
    assert len(beside) > 10
    assert [file for file in beside if not (page.parent / file).is_file()] == []


def test_every_link_into_the_page_has_a_target(text):
    elements = Elements(text)
    ids = [attributes["id"] for _, attributes in elements.found if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {a["href"][1:] for a in elements.all("a") if a["href"].startswith("#")} <= set(ids)


def test_every_point_of_the_scoreboard_links_to_the_row_of_its_cell(text):
    links = [link for rows in tables_of(text, "scoreboard") for link in re.findall(r",#([\w-]+)$", rows, re.MULTILINE)]
    assert len(links) == 21
    assert all(f'<tr id="{link}"' in text for link in links)


def test_the_page_is_below_three_megabytes(page):
    assert page.stat().st_size < 3 * MEGABYTE


def test_the_first_screen_has_the_picture_beside_its_heat_map_and_four_doors(text):
    first = text[: text.index('id="results"')]
    assert (
        first.count("studies_shipped-what_if/picture.png") == first.count("studies_shipped-what_if/heat-map.png") == 1
    )
    doors = re.findall(r'<li><a href="#([\w-]+)">[\w -]+</a> \((\d)\)', first)
    assert doors == [("papers", "1"), ("what-ifs", "1"), ("frontiers", "1"), ("stability", "1")]


def test_every_chart_has_a_still_picture_and_says_what_it_shows(page, text):
    charts = re.findall(r'<div class="view" data-spec="spec-([\w-]+)"><img src="(.*?)" alt="(.+?)"', text)
    assert len(charts) == 5
    assert all((page.parent / picture).read_text().startswith("<svg") for _, picture, _ in charts)
    assert all(f'id="spec-{name}"' in text for name, *_ in charts)


def test_the_table_of_a_chart_is_in_it_as_it_lies_beside_the_page(page, text):
    beside = (page.parent / "studies_shipped-what_if" / "grid.csv").read_text()
    assert tables_of(text, "studies_shipped-what_if-sliders") == [beside]


def test_a_table_without_published_cells_has_no_columns_for_them(text):
    table = re.search(r'aria-label="Cells of frontier-methods">(.*?)</table>', text, re.DOTALL)[1]
    assert re.findall(r'<th scope="col">(.*?)</th>', table) == ["row", "column", "ours", "unit"]


def test_all_boundaries_of_a_folder_stand_in_one_table(text):
    table = re.search(r'<table class="overview">(.*?)</table>', text, re.DOTALL)[1]
    assert re.findall(r'href="#stability-races">(\w+)<', table) == ["tiled", "freepipe"]
    assert table.count("none tried") == 2


def test_words_of_results_are_escaped(text):
    assert "a &lt;b&gt;" in text
    assert "Table 9: times &amp; counts" in text


def test_a_page_without_cells_to_compare_has_no_chart(tmp_path):
    bare = paper()
    bare.cells.clear()
    write_result(bare, tmp_path, Making())
    text = rebuild(tmp_path)[2].read_text()
    assert 'class="view"' not in text
    assert "vegaEmbed=" not in text


def test_the_first_use_of_a_term_links_to_its_explanation():
    glossary = Glossary([{"id": "term-STE", "words": ["STE"], "says": 'tests "that" hit'}])
    marked = glossary.marked("STE < STEs, and the STE of it")
    link = '<a class="term" href="#term-STE" data-says="tests &#34;that&#34; hit">STE</a>'
    assert marked == f"{link} &lt; STEs, and the STE of it"


def test_the_longest_term_is_marked():
    terms = [{"id": "a", "words": ["fitted"], "says": ""}, {"id": "b", "words": ["partly fitted"], "says": ""}]
    assert 'href="#b"' in Glossary(terms).marked("a partly fitted cell")


@pytest.mark.parametrize(
    ("value", "text"), [(None, ""), ("a < b", "a < b"), (12345.6, "12,346"), (1.23456, "1.235"), (0.0, "0")]
)
def test_numbers_have_four_digits(value, text):
    assert number(value) == text


def test_shares_are_per_cent():
    assert [percent(0.1234), percent(0.1234, 0), percent(None)] == ["12.3 %", "12 %", ""]


@pytest.mark.parametrize(
    ("published", "ours", "off", "text"),
    [(1.0, 1.5, 0.5, "+50.0 %"), ("a", "a", None, "as published"), ("a", "b", None, "differs"), (None, 1.0, None, "")],
)
def test_how_far_a_cell_is_off(published, ours, off, text):
    assert error({"published": published, "ours": ours, "error": off}) == text
