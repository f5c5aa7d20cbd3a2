"""Roads not taken, in small: an experiment runs, draws, and says what its numbers say."""

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tilestamp.experiments.harness.write import draw_figure


def check_in_small(road: ModuleType, sizes: dict[str, Any], patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Run a road with other constants: it has cells, an answer, sentences, and pictures that can be drawn."""
    for name, value in sizes.items():
        patch.setattr(road, name, value)
    result = road.run(lambda _: None)
    assert result.cells
    assert result.answer
    assert all(note.endswith(".") for note in result.notes)
    for figure in result.figures:
        draw_figure(figure, result, folder / figure.name)
