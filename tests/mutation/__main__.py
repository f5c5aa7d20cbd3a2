"""``python -m tests.mutation [ROOM ...] [--number N] [--jobs N]``: make mutants, and see which the tests notice.

``--without-ledger`` asks the other tests alone: who judges a number, and does not only hold it as it was?
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from tests.mutation.mutants import ROOT, Mutant, sample
from tests.mutation.rooms import LEDGER, ROOMS

SURVIVORS = Path(__file__).parent / "survivors.toml"  # name of a mutant = why no test need notice it
COPIED = ("models", "simulator", "experiments", "reports", "tests", "tilestamp", "docs", "pyproject.toml", "README.md")
SECONDS = 300.0  # a mutant that takes longer does not end: it is noticed
NO_TESTS = 5  # pytest's exit code


def main() -> int:
    """Try all mutants; 1 where one survives that is not excused."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("rooms", nargs="*", choices=[[], *ROOMS], default=[])
    arguments.add_argument("--number", type=int, help="mutants of each room")
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--without-ledger", action="store_true", help="the other tests alone")
    asked = arguments.parse_args()
    mutants = [
        mutant
        for name in asked.rooms or ROOMS
        for mutant in sample(name, ROOMS[name].paths(), asked.number or ROOMS[name].number, asked.seed)
    ]
    excused = tomllib.loads(SURVIVORS.read_text()) if SURVIVORS.exists() else {}
    with tempfile.TemporaryDirectory() as scratch:
        copies: SimpleQueue[Path] = SimpleQueue()
        for job in range(asked.jobs):
            copies.put(_copy(Path(scratch) / str(job)))
        with ThreadPoolExecutor(asked.jobs) as pool:
            noticed = list(pool.map(lambda mutant: _try(mutant, copies, asked.without_ledger), mutants))
    return _report(mutants, noticed, excused)


def _copy(folder: Path) -> Path:
    """Copy what the tests need."""
    folder.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(
                source, folder / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__", "results")
            )
        else:
            shutil.copy(source, folder / name)
    return folder


def _try(mutant: Mutant, copies: "SimpleQueue[Path]", without_ledger: bool) -> bool:
    """Whether a test notices the mutant."""
    tests = [test for test in ROOMS[mutant.room].tests(mutant.path) if not (without_ledger and LEDGER in test)]
    if not tests:
        return _said(mutant, noticed=False)
    folder = copies.get()
    path = folder / mutant.path
    kept = path.read_text("utf-8")
    try:
        path.write_text(mutant.text, "utf-8")
        command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", *tests]
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=SECONDS, check=False)  # noqa: S603
        noticed = done.returncode not in {0, NO_TESTS}
    except subprocess.TimeoutExpired:
        noticed = True
    finally:
        path.write_text(kept, "utf-8")
        copies.put(folder)
    return _said(mutant, noticed=noticed)


def _said(mutant: Mutant, *, noticed: bool) -> bool:
    sys.stdout.write(f"{'noticed ' if noticed else 'SURVIVED'} {mutant.room}: {mutant.name}\n")
    sys.stdout.flush()
    return noticed


def _report(mutants: list[Mutant], noticed: list[bool], excused: dict[str, str]) -> int:
    """Print how many of each room were noticed, and who survived without an excuse."""
    left = [mutant for mutant, seen in zip(mutants, noticed, strict=True) if not seen]
    for room in dict.fromkeys(mutant.room for mutant in mutants):
        seen = [flag for mutant, flag in zip(mutants, noticed, strict=True) if mutant.room == room]
        sys.stdout.write(f"{room}: {sum(seen)} of {len(seen)} noticed\n")
    sys.stdout.write(
        f"all: {sum(noticed)} of {len(noticed)} noticed, {100 * sum(noticed) / max(1, len(noticed)):.1f} %\n"
    )
    strangers = [mutant for mutant in left if mutant.name not in excused]
    for mutant in left:
        sys.stdout.write(f"survived: {mutant.name}: {excused.get(mutant.name, 'NO REASON GIVEN')}\n")
    return 1 if strangers else 0


if __name__ == "__main__":
    sys.exit(main())
