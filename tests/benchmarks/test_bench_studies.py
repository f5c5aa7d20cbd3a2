"""Speed of studies, by ``pytest tests/benchmarks --benchmark-only``: reported, never asserted."""

import numpy as np
import pytest

from tilestamp import Study
from tilestamp.experiments.studies.store import Store

FRAME = {"scene": "teapot", "size": "1600x1200", "machine": "gtx280"}
NUMBERS = ("sm.clock_mhz", "memory.dram_gb_per_s", "sm.count")


def numbers(points):
    """Three numbers of the machine, walked together."""
    return {name: np.linspace(0.5, 2.0, points).tolist() for name in (f"times.{name}" for name in NUMBERS)}


@pytest.mark.parametrize(("points", "jobs"), [(200, None), (10_000, 2)])
def test_repriced_cells_of_a_teapot_frame(benchmark, scaled, points, jobs):
    """With the execution of the frame, the start of processes, and the store in a file's place in memory."""
    study = Study(fixed=FRAME, zip=numbers(scaled(points)))
    benchmark.pedantic(study.run, kwargs={"jobs": jobs}, rounds=1)
    benchmark.extra_info["cells"] = len(study)


@pytest.fixture(scope="module")
def stored(tmp_path_factory, scaled):
    """Give a study of 100,000 cells of which all are stored, with made-up times."""
    from tilestamp.experiments.studies.cells import missing
    from tilestamp.experiments.studies.parameters import Resolver

    path = tmp_path_factory.mktemp("bench") / "study.sqlite"
    grid = {"zoom": np.linspace(1, 2, 10).tolist(), "sm.clock_mhz": np.linspace(500.0, 1500.0, scaled(10_000)).tolist()}
    study = Study(fixed=FRAME, grid=grid, store=path)
    for group in missing(study, Resolver()):
        for cell in group.cells:
            study.kept.put(cell.key, cell.shown, study.record, {"milliseconds": cell.order / 7}, "")
    return study, path


def test_storing_a_cell(benchmark, tmp_path):
    store, keys = Store(tmp_path / "study.sqlite"), iter(range(10**9))
    shown = dict.fromkeys((*FRAME, *NUMBERS, "tile", "zoom"), 1.0)
    benchmark(lambda: store.put(next(keys).to_bytes(16), shown, ["milliseconds"], {"milliseconds": 1.0}, ""))


def test_resume_of_a_finished_study_of_100_000_cells(benchmark, stored):
    assert benchmark.pedantic(lambda: Study(**design(stored)).run().new, rounds=3) == 0


def test_table_of_a_study_of_100_000_cells(benchmark, stored, scaled):
    assert len(benchmark.pedantic(lambda: Study(**design(stored)).table(), rounds=3)) == scaled(100_000)


def test_open_filter_and_plot_a_store_of_100_000_cells(benchmark, stored, scaled, tmp_path):
    import matplotlib as mpl

    mpl.use("Agg")

    def draw():
        table = Store(stored[1]).table()
        some = table[table["sm.clock_mhz"] > 1000.0].pivot_table("milliseconds", "sm.clock_mhz", "zoom")
        some.plot(legend=False).figure.savefig(tmp_path / "a.png")
        return len(some)

    assert benchmark.pedantic(draw, rounds=3, warmup_rounds=1) == scaled(10_000) // 2


def design(stored):
    study, path = stored
    return {"fixed": study.fixed, "grid": study.grid, "store": path}
