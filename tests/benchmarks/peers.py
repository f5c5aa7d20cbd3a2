"""Speed beside rasterizers that count nothing: ``python -m tests.benchmarks.peers [MILLION ...] [--growth PICTURE]``.

llvmpipe (Mesa's software OpenGL, through moderngl and EGL: Debian's libegl-mesa0 and libgl1-mesa-dri), datashader, and
a plain scan in Numba draw what cudaraster draws, by turns in one process. Absolute times say little on a shared
computer, so each row shows the least of all turns, as a ratio to llvmpipe's. Buffers of the peers are filled before the
clock starts, and no picture is read back. The killeroo (2.4 M quads through micropolygon) is drawn beside 4.8 M
triangles of llvmpipe, where it is on the scene path.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pandas as pd

from tests.benchmarks.test_bench_cudaraster import sphere, waves
from tilestamp.models.errors import MissingInputError
from tilestamp.models.kernel import kernel
from tilestamp.models.machine import load_machine
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions, micropolygon
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.stages.laine2011.triangle_setup import MAX_SUBTRIANGLES

WIDTH, HEIGHT = 1600, 1200
MILLIONS = (0.01, 0.1, 1.0, 4.8)
GROWTH = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 20.0)
MOST_OF_DATASHADER = 5  # million triangles: it copies them into a data frame
KILLEROO = 4_800_000  # triangles: two a quad
COUNTED, UNCOUNTED, PIPE = "all counters", "no counters", "llvmpipe"
PEERS = (PIPE, "datashader", "plain scan")
Draw = Callable[[], Any]


def main() -> None:
    """Time all peers on spheres and waves, and the killeroo; print the ratios; plot the growth where asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("millions", type=float, nargs="*", help="triangles, million")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--growth", help="draw the growth from 10 k to 20 M triangles into this file")
    chosen = parser.parse_args()
    millions = chosen.millions or (GROWTH if chosen.growth else MILLIONS)
    rows = []
    for name, scene_of in (("sphere", sphere), ("waves", waves)):
        for million in millions:
            scene = scene_of(million * 1e6)
            rows += timed(name, len(scene.mesh.triangles), drawers(scene), chosen.rounds)
    if chosen.growth:
        plot(pd.DataFrame(rows), chosen.growth)
    elif not chosen.millions:
        try:
            timed("killeroo", KILLEROO, killeroo(), chosen.rounds)
        except MissingInputError as error:
            sys.stdout.write(f"{error}\n")


def timed(scene: str, triangles: int, draws: dict[str, Draw], rounds: int) -> list[dict[str, Any]]:
    """Time one scene and print its lines."""
    times = least_times(draws, rounds)
    rows = [{"scene": scene, "triangles": triangles, "peer": peer} | found for peer, found in times.items()]
    sys.stdout.write(shown(rows))
    sys.stdout.flush()
    return rows


def killeroo() -> dict[str, Draw]:
    """Draw the killeroo's micropolygons, and beside them as many triangles as two a quad make."""
    scene, view = load_scene("killeroo"), (WIDTH, HEIGHT)
    matrix, simt = read_camera("default", scene).matrix(*view), load_machine("gtx280").simt

    def ours(*, counting: bool) -> Draw:
        return lambda: micropolygon(scene, matrix, *view, simt, MicropolygonOptions(), Executor(counting=counting))

    return {COUNTED: ours(counting=True), UNCOUNTED: ours(counting=False)} | peers(sphere(KILLEROO), (PIPE,))


def drawers(scene: Any) -> dict[str, Draw]:
    """What draws the scene, by name: ours with every counter and without, and the peers that are installed."""
    options = CudarasterOptions(batches=1 + len(scene.mesh.triangles) // MAX_SUBTRIANGLES)  # a draw takes no more

    def ours(*, counting: bool) -> Draw:
        return lambda: cudaraster(scene, np.eye(4), WIDTH, HEIGHT, Simt(), options, Executor(counting=counting))

    return {COUNTED: ours(counting=True), UNCOUNTED: ours(counting=False)} | peers(scene, PEERS)


def peers(scene: Any, names: Iterable[str]) -> dict[str, Draw]:
    """Draw the scene by peers, those that are installed."""
    makers = dict(zip(PEERS, (llvmpipe, datashader, plain_scan), strict=True))
    found: dict[str, Draw] = {}
    for name in names:
        try:
            found[name] = makers[name](scene.mesh)
        except (ImportError, ValueError) as error:
            sys.stdout.write(f"without {name}: {error}\n")
    return found


def llvmpipe(mesh: Any) -> Draw:
    """Draw with depth test and culling of backfaces, vertex colours, no output."""
    os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
    import moderngl

    try:
        context = moderngl.create_context(standalone=True, backend="egl")
    except Exception as error:  # what glcontext raises where there is no EGL
        raise ImportError(error) from error
    program = context.program(
        vertex_shader="#version 330\nin vec4 p; in vec4 c; out vec4 k; void main() { gl_Position = p; k = c; }",
        fragment_shader="#version 330\nin vec4 k; out vec4 o; void main() { o = k; }",
    )
    vertices = [(context.buffer(mesh.positions), "4f", "p"), (context.buffer(mesh.colors), "4f", "c")]
    drawn = context.vertex_array(program, vertices, context.buffer(mesh.triangles))
    target = context.framebuffer(context.texture((WIDTH, HEIGHT), 4), context.depth_texture((WIDTH, HEIGHT)))
    target.use()
    context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)

    def draw() -> None:
        target.clear()
        drawn.render()
        context.finish()

    return draw


def datashader(mesh: Any) -> Draw:
    """Draw triangles with an aggregate for each pixel, without depth."""
    import datashader as ds

    if len(mesh.triangles) > MOST_OF_DATASHADER * 1e6:
        raise ValueError(f"more than {MOST_OF_DATASHADER} M triangles")
    vertices = pd.DataFrame(mesh.positions[:, :3], columns=["x", "y", "z"])
    corners = pd.DataFrame(mesh.triangles, columns=["v0", "v1", "v2"])
    joined = ds.utils.mesh(vertices, corners)
    canvas = ds.Canvas(WIDTH, HEIGHT, x_range=(-1, 1), y_range=(-1, 1))
    return lambda: canvas.trimesh(vertices, corners, mesh=joined, interpolate="nearest")


@kernel
def _scan(positions: Any, triangles: Any, depth: Any, ids: Any) -> None:
    """Test each pixel of each triangle's box, in float32, on one thread."""
    height, width = depth.shape
    half_x, half_y = np.float32(width / 2), np.float32(height / 2)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t]
        ax, ay, az = (positions[i, 0] + 1) * half_x, (positions[i, 1] + 1) * half_y, positions[i, 2]
        bx, by, bz = (positions[j, 0] + 1) * half_x, (positions[j, 1] + 1) * half_y, positions[j, 2]
        cx, cy, cz = (positions[k, 0] + 1) * half_x, (positions[k, 1] + 1) * half_y, positions[k, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area <= 0:
            continue
        for y in range(int(np.ceil(max(min(ay, by, cy) - 0.5, 0))), int(min(max(ay, by, cy) + 0.5, height))):
            for x in range(int(np.ceil(max(min(ax, bx, cx) - 0.5, 0))), int(min(max(ax, bx, cx) + 0.5, width))):
                px, py = np.float32(x + 0.5), np.float32(y + 0.5)
                u = (cx - bx) * (py - by) - (cy - by) * (px - bx)
                v = (ax - cx) * (py - cy) - (ay - cy) * (px - cx)
                w = area - u - v
                z = (u * az + v * bz + w * cz) / area
                if u >= 0 and v >= 0 and w >= 0 and z < depth[y, x]:
                    depth[y, x], ids[y, x] = z, t


def plain_scan(mesh: Any) -> Draw:
    """Draw depths and triangle numbers on one thread, as the first that comes to mind."""
    depth, ids = np.empty((HEIGHT, WIDTH), np.float32), np.empty((HEIGHT, WIDTH), np.int32)

    def draw() -> None:
        depth[:], ids[:] = 1, -1
        _scan(mesh.positions, mesh.triangles, depth, ids)

    return draw


def least_times(draws: dict[str, Draw], rounds: int) -> dict[str, dict[str, float]]:
    """Least wall time and CPU time of each, milliseconds, all by turns after one that warms up."""
    least = {name: {"wall_ms": np.inf, "cpu_ms": np.inf} for name in draws}
    for turn in range(rounds + 1):
        for name, draw in draws.items():
            wall, cpu = time.perf_counter(), time.process_time()
            draw()
            spent = {"wall_ms": 1e3 * (time.perf_counter() - wall), "cpu_ms": 1e3 * (time.process_time() - cpu)}
            if turn:
                least[name] = {clock: min(least[name][clock], ms) for clock, ms in spent.items()}
    return least


def shown(rows: list[dict[str, Any]]) -> str:
    """One scene, a line a peer: times, and ratios to llvmpipe, or to the first where it is not there."""
    rule = next((row for row in rows if row["peer"] == PIPE), rows[0])
    lines = [f"{rows[0]['scene']}, {rows[0]['triangles']:,} triangles, {WIDTH}x{HEIGHT}"]
    lines += [
        f"  {row['peer']:13} wall {row['wall_ms']:8.1f} ms {row['wall_ms'] / rule['wall_ms']:6.2f} x"
        f"   CPU {row['cpu_ms']:8.1f} ms {row['cpu_ms'] / rule['cpu_ms']:6.2f} x"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def plot(table: pd.DataFrame, path: str) -> None:
    """Draw CPU time against triangles, a line a peer."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    scenes = list(dict.fromkeys(table["scene"]))
    figure, axes = plt.subplots(1, len(scenes), figsize=(10, 4.5), sharey=True, layout="constrained")
    for scene, at in zip(scenes, axes, strict=True):
        for peer, rows in table[table["scene"] == scene].groupby("peer", sort=False):
            at.plot(rows["triangles"], rows["cpu_ms"], marker="o", markersize=3, linewidth=1, label=peer)
        at.set(xscale="log", yscale="log", xlabel="triangles", title=f"{scene}, {WIDTH}x{HEIGHT}")
    axes[0].set_ylabel("CPU time, ms")
    axes[0].legend(frameon=False)
    figure.savefig(path, dpi=120)
    table.to_csv(f"{path}.csv", index=False)


if __name__ == "__main__":
    main()
