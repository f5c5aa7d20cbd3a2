"""Hook of mkdocs: pages that are made from the code, and what makes pages of the repository fit the site."""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import api_pages
import architecture_picture
import machine_pages
import mechanism_pictures
import model_tables
import pipeline_pages
import repository_pages
import result_pages
import tutorial_pages
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
Made = dict[str, str | bytes]
SECTIONS = {"Pipelines": "pipelines/", "Machines": "machines/", "Reference": "api/"}


@cache
def pages() -> Made:
    """All files that are made, by their place in the site."""
    made: Made = {}
    rooms = (
        repository_pages, tutorial_pages, pipeline_pages, machine_pages, mechanism_pictures, result_pages, api_pages,
    )  # fmt: skip
    for room in rooms:
        made |= room.pages()
    return made


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages that are made into the navigation, the index of a section first."""
    for entry in config.nav or []:
        for title, folder in SECTIONS.items():
            if isinstance(entry, dict) and title in entry:
                names = [name for name in pages() if name.startswith(folder) and name.endswith(".md")]
                entry[title] = sorted(names, key=lambda name: (not name.endswith("/index.md"), name))
    config.watch += [str(ROOT / "README.md")]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is made."""
    for name, content in pages().items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001 - a hook's
    """Pages of the repository link to files of the repository: those that the site has, it has elsewhere."""
    text = result_pages.with_results(architecture_picture.drawn(markdown))
    for mark, made in (result_pages.TABLES | model_tables.TABLES).items():
        text = text.replace(mark, made()) if mark in text else text
    return "\n".join(_linked(text.split("\n"), page.file.src_uri.count("/")))


def _linked(lines: list[str], depth: int) -> Iterator[str]:
    """Rewrite links outside of code."""
    code = False
    for line in lines:
        code ^= line.lstrip().startswith("```")
        fitting = re.sub(r"\]\((\.\./)+reports/gallery/", f"]({'../' * depth}gallery/", line)
        yield line if code else fitting.replace(".ipynb)", ".md)")
