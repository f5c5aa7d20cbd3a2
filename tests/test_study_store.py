"""The store of studies: what is there is not run again, whatever happened meanwhile."""

import dataclasses
import os
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from tilestamp import Study, TilestampError, read_study
from tilestamp.experiments.studies.store import Store

TINY = {"scene": "teapot", "size": "64x48"}
GRID = {"machine": ["gtx280", "gtx480"], "tile": [4, 8]}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "study.sqlite"


def study(path, **changes):
    return Study(**{"fixed": TINY, "grid": GRID, "store": path} | changes)


def test_a_second_run_does_only_what_is_missing(path):
    first = study(path)
    assert first.run(jobs=1).new == 4
    again = study(path).run(jobs=1)
    assert (again.new, again.executions) == (0, 0)
    assert study(path).table().equals(first.table())


def test_a_machine_more_runs_its_cells_alone_and_a_machine_less_leaves_the_store_as_it_is(path):
    study(path).run(jobs=1)
    more = study(path, grid={**GRID, "machine": ["gtx280", "h200"]})
    assert more.run(jobs=1).new == 2
    assert more.table()["machine"].tolist() == ["gtx280", "gtx280", "h200", "h200"]
    assert len(more.kept) == 6
    assert set(Store(path).table()["machine"]) == {"gtx280", "gtx480", "h200"}


def test_another_number_to_record_runs_the_cells_again_and_keeps_what_was_recorded(path):
    study(path).run(jobs=1)
    other = study(path, record=["tile_raster.milliseconds"])
    assert other.run(jobs=1).new == 4
    assert list(other.table().columns) == ["machine", "tile", "tile_raster.milliseconds"]
    assert study(path).run(jobs=1).new == 0


def test_a_scene_that_changed_since_is_run_again_and_said(path, tmp_path):
    scene = tmp_path / "triangle.obj"
    for height, changed in ((1, []), (2, ["the scene triangle changed"]), (2, [])):
        scene.write_text(f"v 0 0 0\nv 1 0 0\nv 0 {height} 0\nf 1 2 3\n")
        fixed = {"scene": str(scene), "size": "32x32", "pipeline": "freepipe", "machine": "gtx480"}
        summary = study(path, fixed=fixed, grid={}).run(jobs=1)
        assert [said[:26] for said in summary.changed] == changed
    assert summary.new == 0
    assert len(Store(path)) == 2


def test_sources_that_changed_since_are_said_and_their_cells_run_again(path, monkeypatch):
    study(path).run(jobs=1)
    for module in ("parameters", "work"):
        monkeypatch.setattr(f"tilestamp.experiments.studies.{module}.sources_digest", lambda _: "another")
    summary = study(path).run(jobs=1)
    assert summary.new == 4
    assert summary.changed[0].startswith("the sources of the pipeline micropolygon changed")


def test_an_edit_of_another_pipeline_makes_nothing_stale():
    from tilestamp.experiments.harness.sources import ROOT, reached

    found = reached("tilestamp.simulator.pipelines.cudaraster", "tilestamp.simulator.simulation")
    names = {path.relative_to(ROOT).as_posix() for path in found}
    assert "simulator/stages/laine2011/coarse_raster.py" in names
    assert "models/schedule.py" in names
    assert "simulator/pipelines/micropolygon.py" not in names
    assert not any(name.startswith(("experiments", "reports")) for name in names)


COMMAND = "from tilestamp.experiments.command_line import main; main()"
FILE = """
[fixed]
scene = "teapot"
size = "64x48"
[grid]
zoom = { from = 1, to = 2, points = 20 }
"""
WRITE = """
import sys
from pathlib import Path
from tilestamp.experiments.studies.store import Store
store = Store(Path(sys.argv[1]))
for number in range(200):
    store.put(number.to_bytes(16), {"tile": number}, ["milliseconds"], {"milliseconds": float(number)}, "")
"""


def python(code, *arguments):
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # noqa: S603 - our own


def stored(path):
    """Cells of a store, seen from outside."""
    if not path.exists():
        return 0
    try:
        return sqlite3.connect(path).execute("SELECT count(*) FROM cells").fetchone()[0]
    except sqlite3.OperationalError:  # its tables are not there yet
        return 0


def test_kill_9_loses_nothing_that_was_stored(path, tmp_path):
    (tmp_path / "study.toml").write_text(FILE)
    process = python(COMMAND, "study", tmp_path / "study.toml", "-j", "1")
    while stored(path) < 3 and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    left = stored(path)
    assert 3 <= left < 20
    assert sqlite3.connect(path).execute("PRAGMA integrity_check").fetchone() == ("ok",)
    again = read_study(tmp_path / "study.toml", path)
    assert again.run(jobs=1).new == 20 - left
    assert len(again.table()) == 20


def test_two_processes_write_one_store_by_turns(path):
    processes = [python(WRITE, path) for _ in range(2)]
    assert [process.communicate()[1] for process in processes] == ["", ""]
    assert sqlite3.connect(path).execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert sorted(Store(path).table()["milliseconds"]) == [float(number) for number in range(200)]


def test_a_full_disk_is_a_sentence_and_nothing_is_lost(path):
    kept = Store(path)
    kept._base.execute("PRAGMA max_page_count = 12")
    numbers = iter(range(1000))

    def fill():
        for number in numbers:
            kept.put(number.to_bytes(16), {"tile": number}, ["milliseconds"], {"milliseconds": "x" * 500}, "")

    with pytest.raises(TilestampError, match=r"the disk is full .* make room and run again"):
        fill()
    kept.close()
    assert len(Store(path)) == next(numbers) - 1 > 0


def test_a_file_that_is_no_database_is_refused(path):
    path.write_text("this is a text, and a long one, so that it is not taken for the head of a file\n" * 9)
    with pytest.raises(TilestampError, match="is no store of studies"):
        Store(path)
    assert path.read_text().startswith("this is a text")


def test_a_database_of_something_else_is_refused_and_left_alone(path):
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE songs (name TEXT)")
    before = path.read_bytes()
    with pytest.raises(TilestampError, match="is a database, but no store of studies"):
        Store(path)
    assert path.read_bytes() == before


def test_a_store_of_an_older_schema_is_refused(path):
    Store(path).close()
    with sqlite3.connect(path) as base:
        base.execute("PRAGMA user_version = 0")
    with pytest.raises(TilestampError, match="is a store of schema 0, and this tilestamp has schema 1"):
        Store(path)


def test_a_store_in_no_folder_is_refused(tmp_path):
    with pytest.raises(TilestampError, match="there is no folder"):
        Store(tmp_path / "nowhere" / "study.sqlite")


def test_two_studies_share_a_store(path):
    study(path).run(jobs=1)
    other = study(path, title="another", grid={"tile": [8]})
    assert other.run(jobs=1).new == 0
    assert len(other.table()) == 1


def test_the_same_number_as_the_machine_has_is_the_same_cell(path):
    study(path, grid={}).run(jobs=1)
    same = study(path, grid={"sm.count": [30], "times.sm.clock_mhz": [1]})
    assert same.run(jobs=1).new == 0
    assert same.table()["sm.count"].tolist() == [30]


def test_a_table_is_written_as_csv_and_parquet(path, tmp_path):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    from tilestamp.experiments.studies.table import export

    made = dataclasses.replace(study(path), grid={**GRID, "method": {"a": {"spp": 1}, "b": {"spp": 4}}})
    made.run(jobs=1)
    for name, read in (("t.csv", pd.read_csv), ("t.parquet", pd.read_parquet)):
        export(made.table(), tmp_path / name)
        assert read(tmp_path / name)["milliseconds"].tolist() == made.table()["milliseconds"].tolist()
    with pytest.raises(TilestampError, match=r"\.csv or \.parquet"):
        export(made.table(), tmp_path / "t.xls")
