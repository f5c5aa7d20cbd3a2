"""Transparency in CudaRaster that needs no order of input: lists of fragments, k-buffers, stochastic transparency.

Confetti in random order, more and more of it. The truth is exact composition back to front; lists give the nearest byte
to it (tested), so their picture stands for it here. FreePipe's kernel draws the same triangles: an atomic on the pixel
for each fragment, which is the least that its own lists need.

``resolve_h200.csv``: ``resolve_lists`` of ``experiments/cuda/blend.cu`` on the lists of these frames, on an H200, warm;
medians of 15 launches between CUDA events. What it drew was this experiment's picture, byte for byte.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.exploration.transparent_scenes import confetti
from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.reports.methods_plot import panels
from tilestamp.reports.picture import picture
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.laine2011.blend_programs import BUILT_IN, words_of
from tilestamp.simulator.stages.laine2011.fragment_lists import Z_BUFFER_BYTES

QUESTION = "What does transparency without an order of input cost, and how far off are methods that bound its memory?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
MACHINES = ("h200", "gtx480")
SIDE, REACH = 512, 32.0  # pixels of the screen and across a triangle
LAYERS = (1, 2, 4, 8, 12)  # fragments a pixel, about
MIDDLE = 8  # layers of the front and of the picture
TRUTH, IN_ORDER = "linked", "over, in input order"
METHODS: dict[str, dict[str, Any]] = {
    IN_ORDER: {},
    "linked": {"lists": "linked"},
    "round": {"lists": "round"},
    "chunked": {"lists": "chunked", "room": 256},
    "fixed 8": {"lists": "fixed", "room": 8},
    "fixed 32": {"lists": "fixed", "room": 32},
    **{f"k-buffer {k}": {"blend": "k-buffer", "layers": k} for k in (2, 4, 8)},
    **{f"stochastic {s}": {"blend": "stochastic", "layers": s} for s in (4, 16)},
}
GROWN = (IN_ORDER, "linked", "chunked", "fixed 8", "k-buffer 4", "k-buffer 8", "stochastic 16")  # at all layers
SECOND = (IN_ORDER, "linked", "round", "chunked", "fixed 8", "fixed 32", "k-buffer 4")  # on the second machine
SHOWN = ("linked", IN_ORDER, "fixed 8", "k-buffer 4", "stochastic 16")
HARDWARE = (2.1, 3.6)  # memory of a hardware A-buffer over a z-buffer's: Wittenbrink 2001, R-buffer, abstract


def run(progress: Progress) -> Result:
    """Draw more and more layers by each method."""
    rows = []
    for layers in LAYERS:
        progress(f"exploration/order_independent: {layers} layers")
        scene = layered(layers)
        for machine in MACHINES if layers == MIDDLE else MACHINES[:1]:
            truth = drawn(scene, TRUTH, machine)
            depth = truth.frame.facts["fragments_kept"] / SIDE**2
            for method in GROWN if layers != MIDDLE else METHODS if machine == MACHINES[0] else SECOND:
                made = truth if method == TRUTH else drawn(scene, method, machine)
                rows.append({"layers": layers, "fragments": depth, "machine": machine, "method": method,
                             "kind": method.partition(" ")[0].strip(",")} | measured(made, truth, method))  # fmt: skip
    table = pd.DataFrame(rows)
    for _, mine in table[table["layers"] == MIDDLE].groupby("machine"):
        table.loc[mine.index, "front"] = pareto_front(mine["ms"], mine["rms"].round(2))
    table["front"] = table["front"].fillna(False).astype(bool)
    grown = table[(table["machine"] == MACHINES[0]) & table["method"].isin(GROWN)]
    figures = [
        Figure("picture", _draw_pictures),
        Figure("front", partial(_draw_front, table[table["layers"] == MIDDLE])),
        *(Figure(y, partial(_draw_growth, grown, y, label, title)) for y, label, title in GROWTH),
    ]
    title = f"Transparency without order: 1 to {LAYERS[-1]} fragments a pixel, {SIDE}x{SIDE}"
    return finding(
        "order_independent", title, cells(table), figures, notes(table), {"methods": table}, charts=[CHART],
        folder="exploration",
    )  # fmt: skip


CHART = Chart(
    name="front", kind="front", table="methods", title="Error against modelled time; line: what nothing beats.",
    alt="Scatter plot: error of each method of transparency over its modelled time, by layers and machine from lists.",
    of={"x": "ms", "y": "rms", "color": "kind", "label": "method", "front": "front",
        "pick": {"layers": "Layers", "machine": "Machine"},
        "titles": ["modelled time [ms]", "error [steps of a byte, root mean square]"], "log_y": False},
)  # fmt: skip
GROWTH = (
    ("ms", "modelled time [ms]", f"Time by layers, {MACHINES[0]}"),
    ("memory", "bytes / those of a z-buffer with colour", "Memory in DRAM by layers"),
    ("rms", "error [steps of a byte, root mean square]", "Error by layers (lists with room have none)"),
)


def layered(layers: float) -> Scene:
    """Confetti of about so many fragments a pixel."""
    area = REACH**2 * 3 * np.sqrt(3) / 16  # of an equilateral triangle in a circle
    return confetti(SIDE, round(layers * SIDE**2 / area), REACH)


def drawn(scene: Scene, method: str, machine: str) -> Run:
    """One frame."""
    options: dict[str, Any] = {"mode": "blend", "cull_backfaces": False} | METHODS[method]
    return simulate(scene, "cudaraster", machine, width=SIDE, height=SIDE, **options)


def measured(made: Run, truth: Run, method: str) -> dict[str, float]:
    """Time, memory over that of colour and depth, and error of one frame."""
    shown, exact = made.image.astype(np.float64), truth.image.astype(np.float64)
    facts, counts = made.frame.facts, made.counts
    return {
        "ms": made.milliseconds,
        "resolve_ms": float(made.stages["milliseconds"].get("resolve", np.nan)),
        "memory": 1.0 + facts.get("list_share", 0.0),
        "shared_bytes": 4.0 * words(method),
        "rms": float(np.sqrt(np.mean((shown - exact) ** 2))),
        "worst": float(np.abs(shown - exact).max()),
        "lost": float(facts.get("fragments_lost", 0)),
        "longest": float(facts.get("longest_list", 0)),
        "atomics": float(counts.get("fine_raster.ATOMIC_LANES", 0)),
        "conflicts": float(counts.get("fine_raster.ATOMIC_CONFLICTS", 0)),
        "sort_steps": float(counts.get("resolve.SORT_STEPS", 0)),
    }


def words(method: str) -> int:
    """32-bit words a pixel in shared memory, for colours."""
    options = METHODS[method]
    return words_of(BUILT_IN.index(options.get("blend", BUILT_IN[0])), options.get("layers", 1))


def cells(table: pd.DataFrame) -> list[Cell]:
    """Time, memory and error; and the resolve pass beside what an H200 took."""
    said = [("time", "ms", "ms"), ("memory", "z-buffers", "memory"), ("error", "steps of a byte", "rms")]
    found = [
        reported(f"{row['machine']}, {row['layers']} layers, {row['method']}", name, unit, float(row[column]))
        for row in table.to_dict("records")
        for name, unit, column in said
    ]
    mine = table[table["machine"] == MACHINES[0]].set_index(["method", "layers"])["resolve_ms"]
    return found + [
        Cell(f"{row.method}, {row.layers} layers", "resolve pass", "ms", published=row.ms,
             ours=float(mine[row.method, row.layers]), frame=f"confetti {row.layers} {SIDE}x{SIDE}")
        for row in published(__file__, "resolve_h200").itertuples()
    ]  # fmt: skip


def notes(table: pd.DataFrame) -> list[str]:
    """Answer first."""
    first = table[(table["machine"] == MACHINES[0]) & (table["layers"] == MIDDLE)].set_index("method")
    times, off = first["ms"], first["rms"]
    best = first[(first["ms"] < times["chunked"]) & (off > 0)].sort_values("rms")
    fragments = float(first["fragments"].iloc[0])
    mine = published(__file__, "resolve_h200").set_index(["method", "layers"])["ms"]
    slower = times["chunked"] - first.loc["chunked", "resolve_ms"] + mine[TRUTH, MIDDLE]
    base = times[IN_ORDER]
    answer = (
        f"At {fragments:.2g} fragments a pixel on the {MACHINES[0]}, exact lists (nodes in chunks) take "
        f"{times['chunked'] / base:.2f} times as long as blending over in input order ({slower / base:.2f} with the "
        f"resolve pass as measured), which is {off[IN_ORDER]:.0f} steps of a byte off. Of what is faster than they the "
        f"most exact is {best.index[0]}: {best['rms'].iloc[0]:.1f} steps off in "
        f"{best['ms'].iloc[0] / times['chunked']:.2f} times their time."
    )
    said = [
        *map(partial(_atomics, table), MACHINES),
        _freepipe(first),
        _memory(table),
        _bounded(table),
        _resolve(table),
    ]
    return [answer, *said, SURE]


def _atomics(table: pd.DataFrame, machine: str) -> str:
    mine = table[(table["machine"] == machine) & (table["layers"] == MIDDLE)].set_index("method")
    told = ", ".join(
        f"{name} {mine.loc[name, 'ms']:.3g} ms and {mine.loc[name, 'atomics']:,.0f} atomics"
        for name in ("linked", "round", "chunked", "fixed 32")
    )
    return f"{machine}, room for {MIDDLE} layers: {told} (draws of tiles among them)."


def _freepipe(first: pd.DataFrame) -> str:
    made = simulate(layered(MIDDLE), "freepipe", MACHINES[0], width=SIDE, height=SIDE, picture=False)
    return (
        f"FreePipe's kernel alone takes {made.milliseconds:.3g} ms of that frame on the {MACHINES[0]}, for "
        f"{made.counts['freepipe.ATOMIC_LANES']:,.0f} atomics on pixels; CudaRaster with chunks of nodes, sorted and "
        f"blended, {first.loc['chunked', 'ms']:.3g} ms."
    )


def _resolve(table: pd.DataFrame) -> str:
    mine = [cell for cell in cells(table) if cell.published is not None and isinstance(cell.ours, float)]
    told = ", ".join(f"{cell.row} {1000 * cell.ours:.0f} for {1000 * float(cell.published or 0):.0f}" for cell in mine)
    return (
        f"The resolve pass is too fast here, in microseconds by the model for those of an H200: {told}. The model "
        "takes L1 to hold all lists in local memory, which outgrow it where an SM is full."
    )


def _memory(table: pd.DataFrame) -> str:
    mine = table[(table["machine"] == MACHINES[0]) & (table["method"] == "linked")]
    slope = float(np.polyfit(mine["fragments"], mine["memory"], 1)[0])
    where = [(bound - 1.5) / slope for bound in HARDWARE]
    return (
        f"A frame with linked lists takes {mine['memory'].min():.2g} to {mine['memory'].max():.2g} times the memory of "
        f"one with {Z_BUFFER_BYTES} bytes a pixel (colour and depth, which it has besides): {slope:.2g} more for each "
        f"fragment of a pixel. The {HARDWARE[0]} to {HARDWARE[1]} times that Wittenbrink 2001 (R-buffer, abstract) "
        f"gives for a hardware A-buffer are ours at {where[0]:.2f} to {where[1]:.2f} fragments a pixel; its scenes and "
        "its bytes are not known here."
    )


def _bounded(table: pd.DataFrame) -> str:
    mine = table[(table["machine"] == MACHINES[0]) & table["method"].isin(["fixed 8", "k-buffer 8", "stochastic 16"])]
    told = (
        f"{method} {', '.join(f'{off:.1f}' for off in rows.sort_values('layers')['rms'])}"
        for method, rows in mine.groupby("method", sort=False)
    )
    return f"Off by, in steps of a byte at {', '.join(map(str, LAYERS))} layers: {'; '.join(told)}."


SURE = (
    "Counts and pictures are exact; times are priced from our CUDA code (9.0) or by hand (2.x), none but the resolve "
    "pass was measured. The GTX 480's 19.3 ns an atomic at one address is fitted, to Figure 5. Nodes of a tile lie "
    "side by side here, where tiles of a GPU that run at once take theirs by turns. k-buffers and samples have the "
    "48 KB of shared memory a block that the original has, on every machine."
)


def _draw_front(table: pd.DataFrame, path: Path) -> None:
    panels(
        table, path, panel="machine", group="kind", x="ms", y="rms", fronts=["front"],
        x_label="modelled time [ms]", y_label="error [steps of a byte]", title=f"Error against time, {MIDDLE} layers",
    )  # fmt: skip


def _draw_growth(table: pd.DataFrame, y: str, label: str, title: str, path: Path) -> None:
    shown = table[table.groupby("method")[y].transform("max") > 0]
    lines(
        shown, path, x="fragments", y=y, by="method", title=title, x_label="fragments a pixel", y_label=label,
        log_x=True, log_y=y != "memory",
    )  # fmt: skip


def _draw_pictures(path: Path) -> None:
    scene, part = layered(MIDDLE), 160
    images: list[Any] = [drawn(scene, name, MACHINES[0]).image[:part, :part] for name in SHOWN]
    gap = np.full((part, 4, 3), 255, np.uint8)
    row = np.concatenate([piece for image in images for piece in (image, gap)][:-1], axis=1)
    picture(row, path, title="; ".join(SHOWN))
