"""gsplat's profile: frames a second of its garden on a TITAN RTX and on an MI300X, as its documentation has them.

Its dense and packed paths and the original differ in what surrounds the same work: lists by squares of three sigmas,
tiles of 16, a radix sort of 64-bit keys, 256 threads. We draw that; what differs is not modelled (Gaussians of radius
3 and less are left out there: 2 % of the visible ones). Images of a batch follow each other here. Rows of 32 channels
wait for an option; the 49 and 107 million Gaussians of grids 21 and 31 are left out, since they take minutes.
"""

from pathlib import Path

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.splats.executed import executed
from tilestamp.experiments.splats.host import frame_ms
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.library import load_scene

QUESTION = "How many frames a second does gsplat's garden take on a TITAN RTX and on an MI300X?"
SLOW = True  # 2.8 million Gaussians

SOURCE = "gsplat, docs/source/tests/profile.rst (TITAN RTX); AMD's port of it, ROCm documentation 25.10 (MI300X)"
PUBLISHED = Path(__file__).parent / "profile.csv"
WIDTH, HEIGHT = 1920, 1080
AIM = 0.2


def run(progress: Progress) -> Result:
    """Draw the garden on each GPU."""
    table = pd.read_csv(PUBLISHED)
    cells, notes = [], []
    for (machine, grid), rows in table.groupby(["machine", "grid"], sort=False):
        progress(f"garden{grid} on {machine}")
        try:
            scene = load_scene(f"garden{grid}")
        except TilestampError as missing:
            return Result("splats-profile", TITLE, SOURCE, [], warnings=[str(missing)])
        frame = executed(scene, machine, width=WIDTH, height=HEIGHT, picture=False)
        milliseconds = frame_ms(frame)
        stages = ", ".join(f"{name} {ms:.2f}" for name, ms in frame.stages.milliseconds.items())
        host = frame_ms(frame) - frame.milliseconds
        notes.append(f"garden{grid} on {machine}: {milliseconds:.2f} ms: {stages}; the host {host:.2f}.")
        for row in rows.to_dict("records"):
            label = f"grid {grid}, {row['backend']}" + (f", {row['images']} images" if row["images"] > 1 else "")
            ours = 1e3 / (row["images"] * milliseconds)
            cells.append(Cell(label, machine, "FPS", published=row["fps"], ours=ours, aim=AIM, frame=f"garden{grid}"))
    return Result("splats-profile", TITLE, SOURCE, cells, notes=notes)


TITLE = "gsplat's profile: frames a second at 1920x1080"
