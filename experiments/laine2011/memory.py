"""Slides: memory of setup data and queues, five scenes (Laine & Karras 2011)."""

from collections.abc import Sequence

from tilestamp.experiments.harness.cell_bars import cell_bars
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.laine2011.generated import draw, frame_name, scenes, statistics, warning
from tilestamp.experiments.laine2011.sweep import SOURCE
from tilestamp.simulator.stages.laine2011.triangle_setup import SUBTRIANGLE_BYTES

QUESTION = "How much memory do set-up data and queues take?"
SETUP_AIM, QUEUE_FACTOR = 0.05, 1.5
WIDTH, HEIGHT = 1024, 768  # assumed: the slides do not say
QUEUES = {"bin queues": "bin_queues_MB", "tile queues": "tile_queues_MB"}
FIGURE = cell_bars(
    "memory",
    lambda cell: cell.column != "setup data",
    "Memory of the queues, generated scenes (model; published on the real ones)",
    "memory [MB]",
    lambda cell: f"{cell.row} {cell.column}",
)


def run(progress: Progress) -> Result:
    """Compare the bytes of every buffer in use."""
    table = published(__file__, "slides-memory").set_index("scene")
    drawn = {scene.name for scene in scenes()}
    cells: list[Cell] = []
    for scene in statistics():
        row = table.loc[scene.name]
        setup = scene.triangles * SUBTRIANGLE_BYTES["1.1"] / 2**20
        asked, frame = float(row["triangle_setup_MB"]), frame_name(scene.name, WIDTH, HEIGHT)
        cells.append(Cell(scene.name, "setup data", "MB", published=asked, ours=setup, aim=SETUP_AIM, frame=frame))
        if scene.name in drawn:
            progress(f"laine2011/memory: {scene.name}")
            used = draw(scene.name, "cudaraster", WIDTH, HEIGHT).frame.facts["memory_mb"]
            cells += [
                queue_cell(scene.name, queue, float(row[column]), used[queue]) for queue, column in QUEUES.items()
            ]
    title = "Slides: memory in use, CudaRaster, 1024x768"
    answer = _answer(cells)
    notes = [
        (
            f"Queues: aim a factor {QUEUE_FACTOR}. The release has 16 bin streams, the slides speak of 15, one an "
            "SM; each stream of each bin keeps an open segment of 2 KB at the end of each batch."
        ),
    ]
    return Result("laine2011-memory", title, SOURCE, cells, answer, figures=[FIGURE], notes=notes, warnings=[warning()])


def _answer(cells: Sequence[Cell]) -> str:
    """From the least to the most of all scenes, beside what is published."""
    said = []
    for column in dict.fromkeys(cell.column for cell in cells):
        some = [cell for cell in cells if cell.column == column]
        ours, theirs = ([float(getattr(cell, key)) for cell in some] for key in ("ours", "published"))
        said.append(
            f"{column} {min(ours):.3g} to {max(ours):.3g} MB ({min(theirs):.3g} to {max(theirs):.3g} published)"
        )
    return f"By scene, {', '.join(said)}."


def queue_cell(scene: str, queue: str, asked: float, ours: float) -> Cell:
    """One queue; its aim is a factor, so that too little is judged like too much."""
    aim = QUEUE_FACTOR - 1.0 if ours > asked else 1.0 - 1.0 / QUEUE_FACTOR
    return Cell(scene, queue, "MB", published=asked, ours=ours, aim=aim, frame=frame_name(scene, WIDTH, HEIGHT))
