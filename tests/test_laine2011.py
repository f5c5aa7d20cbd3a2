"""The experiments on Laine & Karras 2011: their arithmetic on small scenes, and what was fitted on what."""

import numpy as np
import pytest

from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.result import Cell
from tilestamp.experiments.laine2011 import figure5, figure6, generated, memory, slides, sweep, table2, table3
from tilestamp.experiments.laine2011.heavy_tail import Places, heavy_tail_scene, pareto_areas
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import names_cell
from tilestamp.models.machine import load_machine
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate

TRIANGLES, VISIBLE, PIXELS = 4000, 1600, 12.0
PLACES = Places((0.45, 0.45), ellipse=False, disorder=0.1)
SMALL = heavy_tail_scene("small", TRIANGLES, VISIBLE, PIXELS, 1.2, PLACES)
QUAD = Scene.from_clip_space(
    [[-0.9, -0.9, 0, 1], [0.9, -0.8, 0, 1], [0.8, 0.9, 0, 1], [-0.8, 0.7, 0, 1]], [[0, 1, 2], [0, 2, 3]]
)


def test_at_most_sixteen_published_areas_are_fitted_on():
    assert len(sweep.fitted_areas()) == 9


def test_most_areas_drawn_by_default_are_predicted():
    assert len(set(sweep.DEFAULT_AREAS) - set(sweep.fitted_areas())) > len(sweep.DEFAULT_AREAS) / 2


def test_what_is_fitted_in_the_mix_names_figure_5_or_a_cell_of_table_2():
    for name, kernel in load_mix("cudaraster", "2.0").kernels.items():
        sources = [source for kind, source in kernel.provenance.values() if kind == "fitted"]
        assert all("Figure 5" in source or "Table 2" in source or source.startswith("as ") for source in sources)
        for (event, column), number in kernel.fitted.items():
            several = (event, column) == ("ROP_STEPS", "int32") and name.endswith("msaa")
            assert column == "chain_alu" or several
            assert all(("laine2011-table2" if several else "laine2011-figure5") in cell for cell in number.fitted_to)


def test_of_several_samples_one_cell_was_fitted_to():
    numbers = [number for kernel in load_mix("cudaraster", "2.0").kernels.values() for number in kernel.fitted.values()]
    targets = {cell for number in numbers for cell in number.fitted_to}
    named = [
        c for c in table2_cells() if any(names_cell(t, (c.frame, "laine2011-table2", c.row, c.column)) for t in targets)
    ]
    assert [(cell.row, cell.column) for cell in named] == [("FairyForest, Depth, no blend", "8 samples")]


def test_one_number_of_freepipe_is_fitted_to_buddha_at_the_smallest_size():
    numbers = load_mix("freepipe", "2.0").kernels["freepipe"].fitted
    assert list(numbers) == [("SETUP_STEPS", "fp32")]
    targets = numbers["SETUP_STEPS", "fp32"].fitted_to
    assert targets == ("buddha (generated) 512x384 | laine2011-slides | buddha 512x384 | freepipe",)


@pytest.mark.parametrize("scene", ["sanmiguel", "juarez", "stalker", "city", "buddha"])
def test_the_exponent_of_a_scene_was_fitted_to_one_size(scene):
    ours = dict.fromkeys(generated.PIPELINES, 1.0)
    cells = [cell for size in generated.SIZES for cell in slides.time_cells(scene, size, ours, ours)]
    targets = generated.EXPONENTS[scene].fitted_to
    named = [c for c in cells if any(names_cell(t, (c.frame, "laine2011-slides", c.row, c.column)) for t in targets)]
    assert [cell.column for cell in named] == ["freepipe"]


def test_nothing_of_the_gtx_680_is_fitted_or_measured():
    kinds = {kind for kind, _ in load_machine("gtx680").provenance.values()}
    assert kinds <= {"published", "derived", "assumed"}


def test_times_of_fitted_areas_are_marked_so(monkeypatch):
    run = simulate(QUAD, "cudaraster", "gtx480", width=64, height=48, mode="color")
    monkeypatch.setattr(figure5, "draw", lambda *_: (run, 2))
    monkeypatch.setattr(figure5, "areas", lambda: (1.0, 3.0))
    monkeypatch.setattr(figure5, "counter_cells", lambda *_: [])
    times = [cell for cell in run_judged(figure5.run, str)[0].cells if cell.unit == "ns/triangle"]
    assert {(cell.row, cell.status) for cell in times} == {("1 px", "fitted"), ("3 px", "predicted")}


def test_all_areas_are_published_for_all_stages():
    assert len(sweep.published_ns()) == 161 * 4


def test_the_sweep_takes_areas_from_the_environment(monkeypatch):
    monkeypatch.setenv(sweep.VARIABLE, "3,0.5")
    assert sweep.areas() == (0.5, 3.0)
    monkeypatch.setenv(sweep.VARIABLE, "all")
    assert sweep.areas() == sweep.PUBLISHED_AREAS


@pytest.mark.parametrize("asked", ["0.3", "41", "some"])
def test_the_sweep_refuses_areas_that_were_not_measured(monkeypatch, asked):
    monkeypatch.setenv(sweep.VARIABLE, asked)
    with pytest.raises(TilestampError, match=r"steps of 0\.25"):
        sweep.areas()


def test_counters_are_rounded_like_their_reference():
    reference = published(sweep.__file__, "sweep_counters")
    rows = reference[reference["area"] == 0.5].set_index("counter")["value"]
    exact = {name: value + 1e-4 for name, value in rows.items()}
    cells = figure5.counter_cells(0.5, exact, int(rows["triangles"]))
    assert len(cells) == len(rows)
    assert not any(cell.missed or cell.error for cell in cells)
    assert {cell.status for cell in cells} == {"reproduced"}


@pytest.mark.parametrize("mode", ["depth", "blend", "depth-only", "color"])
@pytest.mark.parametrize("machine", ["gtx480", "gtx680"])
def test_every_mode_of_cudaraster_has_a_time(mode, machine):
    run = simulate(QUAD, "cudaraster", machine, width=64, height=48, mode=mode)
    assert (run.stages["milliseconds"] > 0).all()


def test_interpolation_costs_setup_time():
    setup = [
        simulate(QUAD, "cudaraster", "gtx480", width=64, height=48, mode=mode).stages.loc[
            "triangle_setup", "instructions"
        ]
        for mode in ("color", "depth-only", "depth")
    ]
    assert setup == sorted(set(setup))


@pytest.mark.parametrize("pipeline", ["freepipe", "hardware"])
def test_the_other_pipelines_have_a_time(pipeline):
    assert simulate(QUAD, pipeline, "gtx480", width=64, height=48).milliseconds > 0


def test_every_counter_of_the_authors_profiler_is_compared():
    cells = table3.counter_cells(simulate(QUAD, "cudaraster", "gtx480", width=64, height=48), "reported")
    assert len(cells) == 4 + 6 + 33


@pytest.mark.parametrize("exponent", [0.85, 1.2, 3.0])
def test_generated_areas_have_their_mean_on_the_screen(exponent):
    areas = pareto_areas(100_000, PIXELS, exponent)
    screen = 1024 * 768
    assert np.mean(areas * screen / (areas + screen)) == pytest.approx(PIXELS, rel=1e-6)


def test_areas_fall_by_their_exponent():
    areas = pareto_areas(100_000, PIXELS, 1.5)
    assert np.count_nonzero(areas > 100.0) / np.count_nonzero(areas > 1000.0) == pytest.approx(10**1.5, rel=0.02)


def test_a_smaller_exponent_makes_the_largest_triangle_larger():
    largest = [pareto_areas(100_000, PIXELS, exponent)[0] for exponent in (3.0, 1.5, 1.0)]
    assert largest == sorted(set(largest))


def test_a_generated_scene_has_its_visible_share_and_pixels():
    run = simulate(SMALL, "cudaraster", "gtx480", width=1024, height=768)
    counts, counters = run.counts, run.frame.facts["counters"]
    away, outside = counts["triangle_setup.BACKFACE_CULLED"], counts["triangle_setup.VIEWPORT_CULLED"]
    assert (away, outside) == ((TRIANGLES - VISIBLE) / 2, (TRIANGLES - VISIBLE) / 2)
    survivors = VISIBLE - counters["TriangleSetup / Between pixels cull"] * TRIANGLES / 100
    samples = counters["TriangleSetup / Avg. samples / tri"] * survivors / VISIBLE
    assert samples == pytest.approx(PIXELS, rel=0.15)


def test_generated_triangles_come_in_the_order_of_their_places():
    x = SMALL.mesh.positions[::3, 0]
    assert np.abs(np.diff(x[np.abs(x) <= 2])).mean() < 0.3


def test_an_ellipse_is_filled_evenly():
    ellipse = Places((0.6, 1.0), ellipse=True, disorder=0.0)
    corners = heavy_tail_scene("disc", TRIANGLES, TRIANGLES, 0.01, 9.0, ellipse).mesh.positions
    radius = np.hypot(corners[:, 0] / 0.6, corners[:, 1])
    assert radius.max() < 1.01
    assert np.mean(radius < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.02)


def test_fairyforest_is_as_the_log_counts_it():
    fairy = generated.fairy()
    assert fairy.visible == pytest.approx(100 - 46.2 - 24.4)
    assert fairy.pixels * fairy.visible == pytest.approx(49.92 * (100 - 46.2 - 24.4 - 6.7))


def table2_cells():
    return [
        Cell(f"{scene}, {mode}", f"{samples} samples", "ms", published=1.0, ours=1.0, frame=generated.frame_name(name))
        for scene, name in table2.SCENES.items()
        for mode in table2.MODES
        for samples in table2.SAMPLES
    ]


def test_table_2_is_complete(monkeypatch):
    run = simulate(QUAD, "cudaraster", "gtx480", width=64, height=48)
    monkeypatch.setenv(generated.VARIABLE, "all")
    monkeypatch.setattr(table2, "draw", lambda *_, **__: run)
    cells = table2.run(str).cells
    assert len(cells) == 2 * 3 * 4 + 1
    log = published(sweep.__file__, "gtx480-cuda40")
    rows = log[(log["table"] == "table2") & (log["renderer"] == "CudaRaster")]
    assert sorted(cell.published for cell in cells if cell.unit == "ms") == sorted(rows["value"])


@pytest.mark.parametrize("mode", ["depth", "blend", "depth-only"])
def test_fine_raster_pays_for_every_sample(mode):
    made = [
        simulate(SMALL, "cudaraster", "gtx480", width=256, height=192, mode=mode, msaa=samples, picture=False)
        for samples in (1, 2, 4, 8)
    ]
    fine = [run.stages.loc["fine_raster", "instructions"] for run in made]
    assert fine == sorted(set(fine))
    assert (fine[3] - fine[2]) / (fine[2] - fine[1]) == pytest.approx(2.0, rel=0.2)  # as many more samples


def test_draws_of_tiles_wait_at_one_address():
    run = simulate(QUAD, "cudaraster", "gtx480", width=1024, height=768, picture=False)
    machine = load_machine("gtx480")
    draws = run.counts["fine_raster.ATOMIC"]
    assert draws > 12288
    waited = draws * machine.atomics.unit_ns_per_request * 1e-6
    assert run.stages.loc["fine_raster", "queue_ms"] == pytest.approx(waited)


def test_ratios_are_those_of_the_slides():
    asked = slides.published_ms("city", 1024, 768)
    cells = {cell.column: cell for cell in slides.time_cells("city", (1024, 768), asked, asked)}
    assert cells["SW:HW"].ours == pytest.approx(3.01, abs=0.005)
    assert cells["FP:SW"].ours == pytest.approx(80.54, rel=0.01)


@pytest.mark.parametrize(("ours", "missed"), [(1.55, True), (1.45, False), (0.7, False), (0.6, True)])
def test_a_queue_may_be_too_long_or_too_short_by_a_factor(ours, missed):
    assert memory.queue_cell("", "", 1.0, ours).missed is missed


def test_setup_data_is_within_its_aim_where_the_triangles_are_published():
    table = published(memory.__file__, "slides-memory").set_index("scene")["triangle_setup_MB"]
    for scene in generated.statistics():
        if scene.name not in generated.COUNTED:
            ours = scene.triangles * memory.SUBTRIANGLE_BYTES["1.1"] / 2**20
            assert ours == pytest.approx(table[scene.name], rel=memory.SETUP_AIM)


def test_the_slope_is_that_of_a_line():
    assert figure6.slope(np.array([1, 2, 4]), np.array([3.0, 5.0, 9.0])) == pytest.approx(2.0)


def test_answers_beside_what_is_published_are_computed_from_the_cells():
    ratios = [
        Cell("a", column, "", published=theirs, ours=ours)
        for column, theirs, ours in (("SW:HW", 2.0, 2.5), ("SW:HW", 3.0, 2.25), ("FP:SW", 5.0, 4.0))
    ]
    assert slides._answer(ratios).startswith("CudaRaster takes 2.25 to 2.5 times (2 to 3 published) the hardware's")
    sizes = [Cell(scene, "tile queues", "MB", published=2.0, ours=ours) for scene, ours in (("a", 1.5), ("b", 3.0))]
    assert memory._answer(sizes) == "By scene, tile queues 1.5 to 3 MB (2 to 2 published)."
    times = [Cell("a", f"{n} samples", "ms", published=2.0 * n, ours=1.0 + n) for n in (1, 8)]
    assert table2._answer(times) == "8 samples take 4.50 times as long (8.00 published) for a."
