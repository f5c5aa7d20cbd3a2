"""The tutorial notebooks: each is kept without outputs, and runs from top to bottom in a kernel of its own."""

import json
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).parent.parent / "docs" / "tutorials"
NOTEBOOKS = sorted(path.name for path in TUTORIALS.glob("*.ipynb"))
BY_DOCS = {"reproduce.ipynb"}  # two million triangles: mkdocs runs it, as it does the others (.ci/run)


def test_there_are_tutorials():
    assert {"my-model.ipynb", "reproduce.ipynb", "what-if.ipynb"} == set(NOTEBOOKS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_kept_without_outputs(name):
    cells = json.loads((TUTORIALS / name).read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert not [cell["source"] for cell in code if cell["outputs"] or cell["execution_count"]]


@pytest.mark.parametrize("name", [name for name in NOTEBOOKS if name not in BY_DOCS])
def test_a_notebook_runs(name, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="the extra test has nbclient and ipykernel")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(TUTORIALS / name, 4)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}, timeout=300).execute()
    shown = {kind for cell in notebook.cells for output in cell.get("outputs", ()) for kind in output.get("data", ())}
    assert {"text/html", "image/png"} <= shown
