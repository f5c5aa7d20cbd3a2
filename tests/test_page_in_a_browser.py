"""The page in a real browser, from disk and without network: wide and narrow, light and dark, mouse and keyboard."""

import os
import shutil

import pytest

from tests.page_results import write_page_of_everything

sync = pytest.importorskip("playwright.sync_api", reason="playwright is not here: pip install 'tilestamp[browser]'")
CHROMIUM = os.environ.get("TILESTAMP_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(not CHROMIUM, reason="no Chromium is on the PATH, nor named in TILESTAMP_CHROMIUM")
WIDE, NARROW = 1280, 390
SLIDER = "[name=slider0]"
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    return write_page_of_everything(tmp_path_factory.mktemp("results")).as_uri()


@pytest.fixture(scope="module")
def browser():
    with sync.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser, address):
    contexts = []

    def open_page(width=WIDE, scheme="light", **options):
        viewport = {"width": width, "height": 900}
        context = browser.new_context(
            viewport=viewport, color_scheme=scheme, offline=True, reduced_motion="reduce", **options
        )
        contexts.append(context)
        page = context.new_page()
        page.faults = []
        page.on("pageerror", lambda fault: page.faults.append(str(fault)))
        page.on("console", lambda said: page.faults.append(said.text) if said.type == "error" else None)
        page.on("request", lambda asked: page.faults.append(asked.url) if not asked.url.startswith("file:") else None)
        page.goto(address)
        if options.get("java_script_enabled", True):
            page.wait_for_function(
                "document.querySelectorAll('.live').length == document.querySelectorAll('.view').length"
            )
        return page

    yield open_page
    for context in contexts:
        context.close()


def test_the_page_opens_from_disk_without_faults_and_without_network(visit):
    page = visit()
    assert page.locator(".view svg").count() == 5
    assert page.faults == []


def test_a_slider_changes_the_time(visit):
    page = visit()
    said = page.locator("#chart-studies_shipped-what_if-sliders svg text", has_text="all:")
    assert said.text_content() == "all: 16 ms"
    page.locator(SLIDER).first.fill("0.5")
    page.wait_for_function("[...document.querySelectorAll('svg text')].some(text => text.textContent == 'all: 28 ms')")


def test_the_keyboard_reaches_a_slider_and_moves_it(visit):
    page = visit()
    page.locator(SLIDER).first.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("[...document.querySelectorAll('svg text')].some(text => text.textContent == 'all: 12 ms')")


def test_every_link_into_the_page_leads_somewhere_that_is_seen(visit):
    page = visit()
    targets = {link.get_attribute("href") for link in page.locator("a[href^='#']").all()} - {"#results", "#top"}
    assert len(targets) > 10
    for target in targets:
        page.evaluate(f"location.hash = '{target}'")
        place = page.locator(f"[id='{target[1:]}']")
        sync.expect(place).to_be_visible()
        sync.expect(place).to_be_in_viewport()


def test_a_point_of_the_scoreboard_opens_the_table_of_its_cell(visit):
    page = visit()
    page.locator("#chart-scoreboard .mark-symbol path").first.click(force=True)
    page.wait_for_function("location.hash.startsWith('#eisenacher2010-table9-')")
    sync.expect(page.locator(":target")).to_be_in_viewport()


def test_points_that_are_not_predicted_are_hollow_and_those_of_stand_ins_crosses(visit):
    points = visit().locator("#chart-scoreboard .mark-symbol.role-mark path").all()
    looks = [(point.get_attribute("fill") == "transparent", point.get_attribute("d")) for point in points]
    assert [hollow for hollow, _ in looks] == [n % 5 != 0 for n in range(20)]  # statuses take turns
    assert {n % 5 for n, (_, shape) in enumerate(looks) if shape != looks[0][1]} == {3}


def test_a_word_of_the_glossary_is_explained_to_mouse_and_keyboard(visit):
    page = visit()
    term = page.locator(".lead .term").first
    shown = "getComputedStyle(document.querySelector('.lead .term'), '::after').display"
    assert page.evaluate(shown) == "none"
    term.hover()
    assert page.evaluate(shown) == "block"
    page.keyboard.press("Escape")
    assert page.evaluate(shown) == "none"


def test_the_contents_stay_beside_a_wide_page(visit):
    page = visit()
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    sync.expect(page.get_by_role("navigation").get_by_text("Glossary")).to_be_in_viewport()


def test_the_contents_fold_over_a_narrow_page(visit):
    page = visit(NARROW)
    contents = page.get_by_role("navigation")
    sync.expect(contents).to_be_hidden()
    page.locator("#menu summary").click()
    contents.get_by_text("Stability", exact=True).click()
    sync.expect(contents).to_be_hidden()
    sync.expect(page.locator("h2#stability")).to_be_in_viewport()


@pytest.mark.parametrize("width", [320, NARROW, 768, WIDE])
def test_nothing_runs_out_of_the_page(visit, width):
    page = visit(width)
    page.evaluate("for (const folded of document.querySelectorAll('details')) folded.open = true")
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_plot_has_its_place_before_it_is_loaded(visit, width):
    plot = visit(width).locator("article figure img[loading=lazy]").first
    before = plot.bounding_box()
    plot.scroll_into_view_if_needed()
    plot.evaluate("async (plot) => plot.decode()")
    after = plot.bounding_box()
    assert (before["width"], before["height"]) == (after["width"], after["height"])
    assert 100 < after["height"] <= 381  # to whole pixels of the width


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_each_chart_has_one_legend_at_most_and_none_is_cut(visit, width):
    page = visit(width)
    for view in page.locator(".view").all():
        assert view.locator(".role-legend").count() <= 1
        edge = view.bounding_box()["x"] + view.bounding_box()["width"]
        for entry in view.locator(".role-legend-label text").all():
            assert entry.bounding_box()["x"] + entry.bounding_box()["width"] <= edge


@pytest.mark.parametrize("width", [NARROW, WIDE])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation(visit, width, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not here")
    page = visit(width, scheme)
    page.evaluate("for (const folded of document.querySelectorAll('main details')) folded.open = true")
    found = axe.Axe().run(page).response["violations"]
    assert [(fault["id"], [node["html"] for node in fault["nodes"]]) for fault in found] == []


@pytest.mark.parametrize(("scheme", "is_dark"), [("light", False), ("dark", True)])
def test_the_ground_follows_the_visitors_scheme(visit, scheme, is_dark):
    from io import BytesIO

    import numpy as np
    from PIL import Image

    page = visit(WIDE, scheme)
    seen = np.asarray(Image.open(BytesIO(page.screenshot())).convert("L"), np.float64)
    assert (np.median(seen) < 64) == is_dark
    assert seen.std() > 10  # something is drawn on it


def test_without_scripts_still_pictures_stand_in_for_charts(visit):
    page = visit(java_script_enabled=False)
    stills = page.locator(".view img")
    assert stills.count() == 5
    stills.first.scroll_into_view_if_needed()
    sync.expect(stills.first).to_be_visible()
    assert page.locator(".view svg").count() == 0
