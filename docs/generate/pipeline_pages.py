"""Pipelines: a page for each, made from a frame that it draws, its docstrings, options and mixes."""

import inspect
import sys
from collections import Counter
from functools import cache
from html import escape
from importlib import import_module
from io import BytesIO
from typing import Any

from texts import code, sections, table

from tilestamp import Run, list_machines, load_machine, simulate
from tilestamp.experiments.commands.option_flags import option_table
from tilestamp.simulator.mix import MIXES, load_mix
from tilestamp.simulator.pipelines import load_pipeline, options_type, pipeline_names
from tilestamp.simulator.work import Work

SIZE = {"width": 320, "height": 240}
SCENES = {"tiled": "spot", "per-primitive": "spot", "binned": "spot", "splat": "playbot"}  # textured ones; splats
INTRODUCTION = """# Pipelines

Each pipeline executes a published rasterizer's stages as its CUDA original does, counts what they do, and makes the
picture. What is and is not modelled stands on each page, and in the pipeline's own source.

"""


def pages() -> dict[str, str | bytes]:
    """The index, and a page for each pipeline."""
    rows = [[f"[{name}]({name}.md)", _about(name), len(_stages(run_of(name)))] for name in pipeline_names()]
    made: dict[str, str | bytes] = {
        "pipelines/index.md": INTRODUCTION + table(["pipeline", "what it draws", "stages"], rows)
    }
    for name in pipeline_names():
        made[f"pipelines/{name}.md"] = page(name)
        made[f"pipelines/{name}.png"] = _png(run_of(name))
    return made


def _module(name: str) -> Any:
    return sys.modules[load_pipeline(name).__module__]


def _about(name: str) -> str:
    return (load_pipeline(name).__doc__ or "").strip().splitlines()[0]


@cache
def machines(name: str) -> list[str]:
    """Machines that the pipeline has prices for, the oldest first."""
    oldest = min((int(path.stem[2:]) for path in (MIXES / name).glob("cc*.toml")), default=0)
    described = sorted(map(load_machine, list_machines()), key=lambda machine: float(machine.compute_capability))
    has = {m.name: m.fixed_function is not None or name != "hardware" for m in described}
    return [m.name for m in described if float(m.compute_capability) >= oldest and has[m.name]]


@cache
def run_of(name: str) -> Run:
    """A small frame of the pipeline."""
    return simulate(SCENES.get(name, "teapot"), name, machines(name)[0], **SIZE)


def page(name: str) -> str:
    """The page of one pipeline."""
    run, told = run_of(name), sections(_module(name).__doc__)
    command = f"tilestamp render {run.scene} --pipeline {name} --machine {run.machine.name} -o {name}.png"
    parts = [
        f"# {name}",
        code(told[""]),
        f"![{run.scene} as {name} draws it](./{name}.png)",
        f"```sh\n{command}\n```",
        f"## Stages\n\nOf the frame above ({run.width}x{run.height}, {run.machine.name}), with shares of its time.",
        _diagram(run),
        _stage_table(run),
        "## Counters\n\nColumns of `run.stages` that its stages declare, beside those that every stage has.",
        _counters(run),
        f"## Modelled\n\n{code(told['Modelled'])}",
        f"## Not modelled\n\n{code(told['Not modelled'])}",
        _remarks(name),
        f"## Options\n\n{_options(name)}",
        f"## Prices\n\n{_mixes(name)}",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _stages(run: Run) -> dict[str, list[Any]]:
    """Works by stage, in order."""
    stages: dict[str, list[Any]] = {}
    for work in run.frame.works:
        stages.setdefault(work.stage, []).append(work)
    return stages


def _diagram(run: Run) -> str:
    """Boxes in the order in which the stages run, each with its share of the time."""
    boxes = []
    for stage, row in run.stages.iterrows():
        share = row["milliseconds"] / run.milliseconds
        boxes.append(f"<li><b>{escape(str(stage))}</b><span>{share:.0%}, {escape(str(row['bound']))}</span></li>")
    return f'<ol class="stages">{"".join(boxes)}</ol>'


def _stage_table(run: Run) -> str:
    stages = _stages(run).items()
    rows = [[f"`{stage}`", _does(run.pipeline, works[0]), _unit(works[0]), _buffers(works)] for stage, works in stages]
    return table(["stage", "what it does", "a unit of work", "buffers"], rows)


def _does(pipeline: str, work: Any) -> str:
    """First line of the module of the stage's driver, which bears its name, or of the module of its events."""
    if not isinstance(work, Work):
        return "The fixed-function pipe: " + ", ".join(work.items)
    described = getattr(_module(pipeline), work.stage, None)
    found = described if inspect.isfunction(described) else work.events
    return code(inspect.cleandoc(import_module(found.__module__).__doc__ or "").splitlines()[0])


def _unit(work: Any) -> str:
    if not isinstance(work, Work):
        return "an item of the pipe"
    drawn = {
        "blocks": "a block",
        "block_queue": "an item that a block draws",
        "warp_queue": "an item that a warp draws",
    }
    return f"{drawn[work.dispatch]}, {work.block} threads"


def _buffers(works: list[Any]) -> str:
    streams = dict.fromkeys(f"{stream.op} {stream.buffer}" for work in works for stream in work.streams)
    return ", ".join(streams)


def _counters(run: Run) -> str:
    rows = []
    for name, counter in run.counters.items():
        of = [stage for stage, works in _stages(run).items() if any(c.name == name for c in works[0].counters)]
        rows.append(
            [", ".join(f"`{column}`" for column in counter.columns), counter.title, counter.kind, ", ".join(of)]
        )
    return table(["column", "what it is", "kind", "stages"], rows) if rows else "None.\n"


def _remarks(name: str) -> str:
    remarks = getattr(_module(name), "REMARKS", {})
    if not remarks:
        return ""
    lines = "\n".join(f"- {sentence.replace('{:,}', 'N').replace('{}', 'N')}" for sentence in remarks.values())
    return f"## What a frame may warn of\n\n{lines}"


def _options(name: str) -> str:
    options = option_table(options_type(name))
    rows = [[f"`{key}`", option["takes"], option["default"], option["what"]] for key, option in options.items()]
    return table(["option", "takes", "default", "what it is"], rows) if rows else "It has none.\n"


def _mixes(name: str) -> str:
    if name == "hardware":
        return (
            f"Rates of the pipe's units are in the machine file; machines that have them: {', '.join(machines(name))}."
        )
    rows = []
    for path in sorted((MIXES / name).glob("cc*.toml")):
        mix = load_mix(name, f"{path.stem[2:]}.0")
        kinds = Counter(kind for kernel in mix.kernels.values() for kind, _ in kernel.provenance.values())
        counts = ", ".join(f"{number} {kind}" for kind, number in kinds.most_common())
        rows.append([f"{path.stem[2:]}.x", f"`simulator/mixes/{name}/{path.name}`", len(mix.kernels), counts])
    told = f"Instructions an event, by compute capability. Machines: {', '.join(machines(name))}.\n\n"
    return told + table(["family", "file", "kernels", "tables by provenance"], rows)


def _png(run: Run) -> bytes:
    from PIL import Image

    data = BytesIO()
    Image.fromarray(run.image).save(data, "png", optimize=True)
    return data.getvalue()
