"""The documentation: what the site's pages take from the code is there, links lead somewhere, commands work."""

import re
import shlex
from importlib import import_module
from inspect import cleandoc
from pathlib import Path

import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.registry import select
from tilestamp.simulator.pipelines import pipeline_names

ROOT = Path(__file__).parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / "reports" / "gallery" / "README.md"])
MADE = ("machines/", "pipelines/", "time/", "atlas.md")  # pages of the site that are made when it is built
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
