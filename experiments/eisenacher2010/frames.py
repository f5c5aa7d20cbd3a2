"""The paper's frames: its models from its views on its machine, each executed once."""

from tilestamp.models.fitted import Fitted
from tilestamp.models.price import Fidelity
from tilestamp.models.remembered import remembered
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.library import is_stand_in, scene_or_stand_in
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate

SOURCE = "Eisenacher & Loop, Data-parallel Micropolygon Rasterization, Eurographics 2010 short papers"
MACHINE = "gtx280"
STAND_IN = "STAND-IN, not the paper's model"
KILLEROO = "killeroo 1600x1200"  # the frame of most cells, as fitted numbers name it
OVERHEAD = Fitted(  # table 3's own cell, taken over
    "eisenacher2010: milliseconds of system overhead",
    4.6,
    (f"{KILLEROO} | eisenacher2010-table3 | system overhead | 1 spp",),
)
OVERHEAD_PIXELS = 1600 * 1200  # of that cell
FIXED_OVERHEAD = Fitted(  # the rest goes with the pixels: assumed
    "eisenacher2010: milliseconds of system overhead that a frame of any size has",
    1.87,
    ("teapot 512x512 | eisenacher2010-table2 | teapot 512x512 BB 8 | 1 spp",),
)


@remembered
def model(name: str) -> Scene:
    """The model, or a stand-in of about as many patches where the file is missing."""
    return scene_or_stand_in(name)


@remembered
def frame(
    name: str = "killeroo",
    width: int = 1600,
    height: int = 1200,
    *,
    tile: int = 8,
    spp: int = 1,
    bound: float = 4,
    view: str = "default",
    box_tests: bool = True,
    edges: str = "computed",
    hybrid: bool = False,
    fidelity: Fidelity = "schedule",
) -> Run:
    """One frame of the paper; ``pixel_extent`` is the reading of its bound that fits its counts (``scenes.views``)."""
    scene = model(name)
    return simulate(
        scene,
        "micropolygon",
        MACHINE,
        width=width,
        height=height,
        camera=view if view in scene.views else "default",
        tile=tile,
        spp=spp,
        bound=bound,
        bound_rule="pixel_extent",
        box_tests=box_tests,
        edges=edges,
        hybrid=hybrid,
        fidelity=fidelity,
    )


def overhead_ms(run: Run) -> float:
    """What the paper calls system overhead: a part that every frame has, and one that goes with the pixels."""
    fixed = FIXED_OVERHEAD.value
    return fixed + (OVERHEAD.value - fixed) * run.width * run.height / OVERHEAD_PIXELS


def stand_in_warnings(*names: str) -> list[str]:
    """What is to be said where models are missing, or their files were not read whole."""
    models = map(model, names)
    return [
        f"{STAND_IN if is_stand_in(one) else one.name}: {one.note.removeprefix('stand-in: ')}"
        for one in models
        if one.note
    ]


def stage_ms(run: Run, *stages: str) -> float:
    """Milliseconds of some stages."""
    return float(run.stages.loc[list(stages), "milliseconds"].sum())
