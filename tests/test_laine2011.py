"""The experiments on Laine & Karras 2011: their arithmetic on small scenes, and what was fitted on what."""

import numpy as np
import pytest

from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.laine2011 import figure5, figure6, generated, memory, slides, sweep, table3
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate

GENERATED = generated.Statistics("small", 4000, 40.0, 12.0, assumed=False)
QUAD = Scene.from_clip_space(
    [[-0.9, -0.9, 0, 1], [0.9, -0.8, 0, 1], [0.8, 0.9, 0, 1], [-0.8, 0.7, 0, 1]], [[0, 1, 2], [0, 2, 3]]
)


def test_at_most_sixteen_published_areas_are_fitted_on():
    assert len(sweep.fitted_areas()) == 9


def test_most_areas_drawn_by_default_are_predicted():
    assert len(set(sweep.DEFAULT_AREAS) - set(sweep.fitted_areas())) > len(sweep.DEFAULT_AREAS) / 2


def test_what_is_fitted_in_the_mix_names_figure_5():
    for kernel in load_mix("cudaraster", "2.0").kernels.values():
        sources = [source for kind, source in kernel.provenance.values() if kind == "fitted"]
        assert all("Figure 5" in source or source.startswith("as ") for source in sources)
        assert all("laine2011-figure5" in cell for number in kernel.fitted.values() for cell in number.fitted_to)
        assert {column for _, column in kernel.fitted} <= {"chain_alu", "chain_atomic"}


def test_nothing_of_freepipe_is_fitted():
    for kernel in load_mix("freepipe", "2.0").kernels.values():
        assert {kind for kind, _ in kernel.provenance.values()} == {"derived"}


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


def test_generated_areas_have_their_mean():
    areas = generated._areas(np.random.default_rng(1), GENERATED)
    assert areas.mean() == pytest.approx(GENERATED.pixels)


def test_a_generated_scene_has_its_visible_share():
    counts = simulate(generated.generate(GENERATED), "cudaraster", "gtx480", width=1024, height=768).counts
    away = counts["triangle_setup.BACKFACE_CULLED"] / GENERATED.triangles
    assert 1.0 - away == pytest.approx(GENERATED.visible / 100, abs=0.03)


def test_generated_triangles_come_in_the_order_of_their_places():
    x = generated.generate(GENERATED).mesh.positions[::3, 0]
    assert np.abs(np.diff(x)).mean() < 0.3


def test_ratios_are_those_of_the_slides():
    asked = slides.published_ms("city", 1024, 768)
    cells = {cell.column: cell for cell in slides.time_cells("", asked, asked)}
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
