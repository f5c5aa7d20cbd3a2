"""The accuracy page: what it says of a small folder of results, and that the one in docs was written by it."""

import json

import pandas as pd
import pytest

from tilestamp.experiments.calibration.accuracy import MARKER, PLOT, main, page
from tilestamp.experiments.calibration.accuracy_tables import (
    ROOT,
    checked_against,
    choices,
    on_one_generation,
    read_results,
)
from tilestamp.models.machine import list_machines

COLUMNS = ["scene", "W", "tile", "spp", "kernel", "quantity", "ours", "measured", "bound"]
SEEN = [
    ("bunny", 512, 0, 0, "binRaster", "time", 12.0, 10.0, "issue"),
    ("bunny", 512, 0, 0, "binRaster", "time", 4.0, 1.0, "issue"),  # too short to count
    ("bunny", 512, 0, 0, "binRaster", "instructions", 102.0, 100.0, ""),
    ("bigguy", 512, 4, 1, "k_raster", "time", 90.0, 100.0, "dram"),
    ("bigguy", 512, 8, 1, "k_raster", "time", 80.0, 200.0, "dram"),
    ("bigguy", 512, 4, 4, "k_raster", "time", 90.0, 100.0, "dram"),
    ("bigguy", 512, 8, 4, "k_raster", "time", 95.0, 104.0, "dram"),  # too close to choose
]
UNSEEN = [("bunny", 512, 0, 0, "binRaster", "time", 8.0, 10.0, "issue")] * 30
FRAMES = [  # config, ours, measured
    ("tiled_t8_cull_original", 8.0, 10.0),
    ("tiled_t32_cull_original", 9.0, 20.0),
    ("tiled_t8_cull_ssao", 1.0, 1.0),
    ("per_primitive_cull", 5.0, 30.0),
]


def write(folder, experiment, rows, columns):
    table = pd.DataFrame(rows, columns=columns)
    place = folder / experiment
    place.mkdir()
    table.assign(error=table.ours / table.measured - 1.0, aim=0.1).to_csv(place / "all.csv", index=False)
    about = {
        "experiment": experiment,
        "date": "2026-11-29T00:00",
        "source_digest": "abc",
        "warnings": ["di is left out: why"],
    }
    (place / "manifest.json").write_text(json.dumps(about))


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    write(folder, "silicon-h200", SEEN, COLUMNS)
    write(folder, "silicon-unseen", UNSEEN, COLUMNS)
    frames = [("ru_cow_far", config, "frame", "frame time", ours, theirs) for config, ours, theirs in FRAMES]
    write(folder, "silicon-textured_ru", frames, ["scene", "config", "kernel", "quantity", "ours", "measured"])
    return folder


def test_a_scene_is_seen_in_the_experiment_whose_cells_a_number_was_fitted_to(results):
    table = read_results(results)
    seen = set(table[table.seen][["experiment", "scene"]].itertuples(index=False, name=None))
    assert seen == {("silicon-h200", "bunny")}


def test_times_over_5_us_by_kernel_seen_and_unseen_apart(results):
    text = page(results)
    assert (
        "| CudaRaster | binRaster | 10 to 10 | 1 | 20 / 20 % | 1.20 to 1.20 | 30 | 20 / 20 % | 0.80 to 0.80 |" in text
    )
    assert "| micropolygons | k_raster, 1 spp | 100 to 200 |  |  |  | 2 | 35 / 60 % | 0.40 to 0.90 |" in text
    assert "| all | 35 | 20 % | 60 % | 97 % |" in text


def test_counts_stand_beside_their_aims(results):
    assert "| instructions | 3 % | 1 | 2 / 2 % | 100 % |  |  |  |" in page(results)


def test_the_fastest_counts_where_the_next_is_slower_by_5_percent(results):
    found = choices(read_results(results))
    assert found["tile size of the micropolygon raster"] == [("4", "8")]
    assert found["tile size of Ru 2016's frames"] == [("tiled_t8", "tiled_t8")]
    assert found["Ru 2016's tiles or a thread a triangle"] == [("tiled", "per_primitive")]


def test_intervals_are_those_of_the_other_experiments(results):
    text = page(results)
    assert "| `silicon-h200`, from all others | 5 | 80.0 % |" in text
    assert "silicon-unseen`, from" not in text  # five times give no interval of 95 %


def test_terms_stand_in_order_of_their_share_of_all_error(results):
    _, _, rest = page(results).partition("by the term that holds")
    terms = [line.split(" | ")[0] for line in rest.splitlines() if line.startswith(("| issue", "| dram"))]
    assert terms == ["| issue", "| dram"]
    assert "| issue | 31 | 20 / 20 % | 0.80 to 1.20 | 87 % |" in rest


def test_a_run_says_which_scenes_it_leaves_out(results):
    assert "- silicon-h200, 2026-11-29, sources abc; without di" in page(results)


def test_every_machine_file_says_what_it_was_checked_against():
    found = checked_against()
    assert set(found) == set(list_machines())
    assert all(text.endswith(".") and "#" not in text for _, text in found.values())


def test_locks_in_dram_were_seen_on_one_generation_and_registers_are_published():
    found = on_one_generation()
    assert "atomics.conflict_ns" in dict(found["1.3"])
    assert "sm.registers" not in {key for numbers in found.values() for key, _ in numbers}


def test_page_and_plot_are_written_into_a_checkout(results, tmp_path):
    for name in ("docs", "reports"):
        (tmp_path / name).mkdir()
    main(results, tmp_path)
    assert (tmp_path / "docs" / "accuracy.md").read_text().startswith(MARKER)
    assert (tmp_path / PLOT).stat().st_size > 0


def test_the_page_in_docs_was_written_by_the_generator():
    text = (ROOT / "docs" / "accuracy.md").read_text("utf-8")
    assert text.startswith(MARKER)
    assert (ROOT / PLOT).is_file()
    assert all(f"| `{name}` | {what} | {checked} |" in text for name, (what, checked) in checked_against().items())
