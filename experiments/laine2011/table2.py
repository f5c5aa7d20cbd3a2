"""Table 2: samples a pixel in three modes, FairyForest and Buddha, GTX 480 (Laine & Karras 2011)."""

from collections.abc import Sequence

from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.laine2011.generated import FAIRY, VARIABLE, draw, everything, frame_name, time_bars, warning
from tilestamp.experiments.laine2011.sweep import HEIGHT, SOURCE, WIDTH

QUESTION = "What do more samples a pixel cost?"
SLOW = True  # several frames of a million triangles

SCENES = {"FairyForest": FAIRY, "Buddha": "buddha"}
MODES = {"Depth, no blend": "depth", "No depth, alpha blend": "blend", "Depth only": "depth-only"}
SAMPLES = (1, 2, 4, 8)
AIM = 0.2
EMITS = "CoarseRaster / Emits / Triangle"


def run(progress: Progress) -> Result:
    """Draw generated scenes with 1, 2, 4 and 8 samples."""
    cells: list[Cell] = []
    for scene, name in SCENES.items():
        for label in modes():
            progress(f"laine2011/table2: {scene}, {label}")
            cells += [time_cell(scene, name, label, samples) for samples in SAMPLES]
    cells.append(emits_cell())
    title = "Table 2: samples a pixel, CudaRaster, 1024x768, GTX 480"
    answer = _answer(cells)
    figures = [time_bars("samples", lambda cell: cell.unit == "ms", "Samples a pixel")]
    notes = [
        (
            "One number of all that several samples cost is fitted, on one cell: FairyForest, depth, no blend, 8 "
            "samples. The rest of their mix is operations counted by hand; that of blending anew, after its error "
            "had been seen."
        ),
        f"{len(modes())} of {len(MODES)} modes were drawn; {VARIABLE}=all draws all.",
    ]
    return Result("laine2011-table2", title, SOURCE, cells, answer, figures=figures, notes=notes, warnings=[warning()])


def _answer(cells: Sequence[Cell]) -> str:
    """What the most samples take over one, by scene and mode."""
    said = []
    for row in dict.fromkeys(cell.row for cell in cells if cell.unit == "ms"):
        times = {cell.column: cell for cell in cells if cell.row == row}
        one, most = (times[f"{samples} samples"] for samples in (SAMPLES[0], SAMPLES[-1]))
        ours, theirs = (float(getattr(most, key)) / float(getattr(one, key)) for key in ("ours", "published"))
        said.append(f"{ours:.2f} times as long ({theirs:.2f} published) for {row}")
    return f"{SAMPLES[-1]} samples take {'; '.join(said)}."


def modes() -> list[str]:
    """Modes to draw."""
    return list(MODES) if everything() else list(MODES)[:1]


def time_cell(scene: str, name: str, label: str, samples: int) -> Cell:
    """Time of a frame."""
    log = published(__file__, "gtx480-cuda40")
    rows = log[(log["table"] == "table2") & (log["renderer"] == "CudaRaster") & (log["scene"] == scene)]
    asked = rows.loc[(rows["key"] == label) & (rows["column"] == f"msaa{samples}_ms"), "value"]
    made = draw(name, "cudaraster", WIDTH, HEIGHT, mode=MODES[label], msaa=samples)
    column = f"{samples} samples"
    frame = frame_name(name)
    return Cell(
        f"{scene}, {label}", column, "ms", published=float(asked.iloc[0]), ours=made.milliseconds, aim=AIM, frame=frame
    )


def emits_cell() -> Cell:
    """Tiles of a triangle of the generated FairyForest: what the exponent of its areas was chosen on."""
    log = published(__file__, "gtx480-cuda40")
    rows = log[(log["table"] == "table3") & (log["scene"] == "FairyForest") & (log["key"] == EMITS)]
    ours = draw(FAIRY, "cudaraster", WIDTH, HEIGHT, mode="depth", msaa=1).frame.facts["counters"][EMITS]
    asked = float(rows["value"].iloc[0])
    return Cell("FairyForest", "tiles a triangle", "", published=asked, ours=ours, frame=frame_name(FAIRY))
