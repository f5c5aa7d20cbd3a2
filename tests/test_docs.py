"""The documentation: what the site's pages take from the code is there, links lead somewhere, commands work."""

import json
import re
import shlex
from importlib import import_module
from inspect import cleandoc
from pathlib import Path

import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.registry import experiment_names, select
from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines import pipeline_names

ROOT = Path(__file__).parent.parent
ROADS = sorted((ROOT / "docs" / "exploration").glob("*.md"))
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *ROADS, ROOT / "reports" / "gallery" / "README.md"])
MADE = (
    "machines/",
    "pipelines/",
    "time/",
    "atlas.md",
    "../atlas.md",
)  # pages of the site that are made when it is built
FLOORS = ("models", "simulator", "experiments", "reports")
NEEDS_A_GPU = {"measure-machine", "validate"}


def faq() -> list[str]:
    """Commands of the page of questions, one a line, without comments."""
    blocks = re.findall(r"^```sh\n(.*?)^```", (ROOT / "docs" / "faq.md").read_text("utf-8"), re.MULTILINE | re.DOTALL)
    lines = [part.partition("#")[0].strip() for block in blocks for part in re.split(r"\n|&&", block)]
    return sorted({line for line in lines if line.startswith("tilestamp ")})


def targets(page: Path) -> list[str]:
    """Files that a page links to, outside of its code."""
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    return [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]


@pytest.mark.parametrize("name", pipeline_names())
def test_a_pipeline_says_what_is_modelled_and_what_is_not(name):
    text = cleandoc(import_module(f"tilestamp.simulator.pipelines.{name.replace('-', '_')}").__doc__ or "")
    for title in ("Modelled", "Not modelled"):
        assert re.search(rf"^{title}\n-+\n- \w", text, re.MULTILINE), title


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    lost = [to for to in targets(page) if to and not to.startswith(MADE) and not (page.parent / to).exists()]
    assert lost == []


def test_a_lost_link_is_found(tmp_path):
    (tmp_path / "page.md").write_text("[a](b.md#c) `[no](x.md)` [web](https://d.e)\n```\n[no](y.md)\n```\n")
    assert targets(tmp_path / "page.md") == ["b.md"]


def test_each_of_the_six_questions_has_a_command():
    parts = re.split(r"^## ", (ROOT / "docs" / "faq.md").read_text("utf-8"), flags=re.MULTILINE)[1:]
    assert len(parts) == 6
    assert [part.splitlines()[0] for part in parts if "\ntilestamp " not in part and "&& tilestamp" not in part] == []


@pytest.mark.parametrize("command", faq())
def test_a_command_of_the_questions_works(command, tmp_path, monkeypatch, capsys):
    """Frames are drawn small; what needs a GPU is looked up; experiments are found by their name."""
    monkeypatch.chdir(tmp_path)
    _, name, *rest = shlex.split(command)
    if name == "reproduce":
        assert select(tuple(rest))
        return
    if name in NEEDS_A_GPU:
        rest = ["--help"]
    elif "--size" in rest:
        rest[rest.index("--size") + 1] = "96x72"
    else:
        rest += ["--size", "96x72"]
    assert run_command([name, *rest]) == 0, capsys.readouterr().err


@pytest.fixture
def generate(monkeypatch):
    """Import a module of those that make pages."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "generate")
    return import_module


def test_a_machines_page_has_each_number_with_where_it_is_from(generate):
    machine = load_machine("h200")
    page = generate("machine_pages").pages()["machines/h200.md"]
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| `")]
    found = {(row[0].strip("| `"), row[2]) for row in rows}
    assert found == {(key.partition(".")[2], kind) for key, (kind, _) in machine.provenance.items()}


def test_a_pipelines_page_has_its_stages_in_order_its_options_and_what_is_not_modelled(generate):
    page = generate("pipeline_pages").page("tiled")
    run = generate("pipeline_pages").run_of("tiled")
    boxes = re.findall(r"<li><b>(.*?)</b>", page)
    assert boxes == list(run.stages.index)
    assert [name for name in run.options if f"| `{name}` |" not in page] == []
    assert "## Not modelled\n\n- Clipping" in page


def test_the_reference_has_every_module(generate):
    pages = "\n".join(generate("api_pages").pages().values())
    package = ROOT / "tilestamp"
    modules = [path for floor in FLOORS for path in (package / floor).rglob("[a-z]*.py") if "/_" not in str(path)]
    names = [f"::: {'.'.join(path.relative_to(ROOT).with_suffix('').parts)}\n" for path in modules]
    assert [name for name in names if name not in pages] == []


def test_the_atlas_shows_what_a_results_folder_has(generate, tmp_path, monkeypatch):
    result = tmp_path / "stability-cracks"
    result.mkdir()
    (result / "cracks.png").write_bytes(b"plot")
    (result / "boundaries.csv").write_text(
        "method,parameter,unit,holds,breaks,wrong,cure,cost\nm,p|q,u,1.23456789,,w,c,\n"
    )
    monkeypatch.setenv("TILESTAMP_RESULTS", str(tmp_path))
    made = generate("result_pages").pages()
    assert made["atlas/cracks-cracks.png"] == b"plot"
    assert "| m | p\\|q [u] | 1.2346 |  | w; cure: c |" in made["atlas.md"]
    assert '<a href="#cracks"><img src="atlas/cracks-cracks.png"' in made["atlas.md"]
    assert "`tilestamp reproduce stability/slivers` draws it" in made["atlas.md"]


def test_a_road_shows_what_a_results_folder_has(generate, tmp_path, monkeypatch):
    result = tmp_path / "exploration-shading"
    result.mkdir()
    said = {"answer": "So much.", "notes": ["So much.", "More."], "figures": [{"file": "plot.png", "alt": "Lines"}]}
    (result / "result.json").write_text(json.dumps(said))
    (result / "plot.png").write_bytes(b"plot")
    monkeypatch.setenv("TILESTAMP_RESULTS", str(tmp_path))
    room = generate("result_pages")
    monkeypatch.setattr(room, "describe", lambda _: "Title.")
    page = room.with_results("a\n\n<!-- result exploration/shading -->\n")
    assert page == "a\n\nSo much.\n\n- More.\n\n![Lines](shading-plot.png){ loading=lazy }\n"


def test_every_road_has_a_page_that_shows_its_result():
    names = [name for name in experiment_names() if name.startswith("exploration/")]
    shown = {mark for page in ROADS for mark in re.findall(r"<!-- result (\S+) -->", page.read_text("utf-8"))}
    assert set(names) == shown


def test_the_overview_has_each_road_once_in_the_order_of_the_navigation():
    overview = re.findall(r"\]\((\w+\.md)\)", (ROOT / "docs" / "exploration" / "index.md").read_text("utf-8"))
    navigation = re.findall(r"- exploration/(\w+\.md)", (ROOT / "mkdocs.yml").read_text("utf-8"))
    assert ["index.md", *overview] == navigation


def test_the_table_of_silicon_has_the_measured_beside_the_model(generate):
    text = generate("model_tables").silicon()
    cells = [line.split(" | ")[1:3] for line in text.splitlines()[2:]]
    pairs = [(float(known), float(ours.strip(" |"))) for known, ours in cells if known]
    assert len(pairs) >= 9
    assert all(ours == pytest.approx(known, rel=0.1, abs=0.1) or known > 13 for known, ours in pairs)


def test_each_mark_for_a_table_is_on_a_page(generate):
    text = "".join(page.read_text("utf-8") for page in PAGES)
    marks = generate("model_tables").TABLES | generate("result_pages").TABLES
    assert set(re.findall(r"^<!-- .* -->$", text, re.MULTILINE)) >= set(marks)
