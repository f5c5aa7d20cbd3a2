"""Tutorials: the notebooks, run from top to bottom, as pages."""

from base64 import b64decode
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from nbclient import NotebookClient

TUTORIALS = Path(__file__).resolve().parents[1] / "tutorials"
LIMIT = 600  # seconds of a cell


def pages() -> dict[str, str | bytes]:
    """A page for each notebook, and the plots of its cells; a cell that fails ends the build."""
    made: dict[str, str | bytes] = {}
    for path in sorted(TUTORIALS.glob("*.ipynb")):
        notebook = nbformat.read(path, 4)
        with TemporaryDirectory() as folder:
            NotebookClient(notebook, resources={"metadata": {"path": folder}}, timeout=LIMIT).execute()
        made |= _page(path.stem, notebook.cells)
    return made


def _page(name: str, cells: list[Any]) -> dict[str, str | bytes]:
    parts: list[str] = []
    plots: dict[str, str | bytes] = {}
    for cell in cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source.replace(".ipynb)", ".md)"))
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                plot = f"{name}-{len(plots)}.png"
                plots[f"tutorials/{plot}"] = b64decode(data["image/png"])
                parts.append(f"![what the cell above draws]({plot})")
            elif "text/html" in data:
                parts.append(f'<div class="output">\n{_joined(data["text/html"])}\n</div>')
            else:
                parts.append(f"```text\n{output.get('text') or data.get('text/plain', '')}\n```")
    source = f"[This page is a notebook](https://jupyter.org): `docs/tutorials/{name}.ipynb`."
    return {f"tutorials/{name}.md": "\n\n".join([*parts, source]) + "\n"} | plots


def _joined(html: str) -> str:
    """HTML without the empty lines at which Markdown would end it."""
    return "\n".join(line for line in html.splitlines() if line.strip())
