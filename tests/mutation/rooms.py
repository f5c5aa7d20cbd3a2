"""Which files are mutated, how often, and which tests have to notice."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.mutants import ROOT
from tilestamp.simulator.pipelines import pipeline_names

LEDGER = "tests/test_ledger.py"
PLUMBING = ("kernel", "kernel_cache", "kernel_library", "kernel_digest", "compile_cache", "used", "errors")  # no rules
SLOW = {"test_architecture", "test_frontier_methods", "test_silicon", "test_stability_overflow"}
PIPELINE_TESTS = {
    "ru2016": ("tests/test_textured_mesh.py",),
    "zhang2025": ("tests/test_counts_of_zhang.py", "tests/test_textured_mesh.py"),
}
STAGES = {  # folder of stages: pipelines that run them
    "eisenacher2010": ("micropolygon",),
    "laine2011": ("cudaraster",),
    "liu2010": ("freepipe",),
    "fatahalian2009": ("stamps", "across-polygons", "interval", "interleaved"),
    "yao2011": ("bit-mask",),
    "ru2016": ("tiled", "per-primitive"),
    "zhang2025": ("binned",),
}


@dataclass(frozen=True)
class Room:
    """Files of one kind.

    Parameters
    ----------
    globs : tuple of str
        The files, from the root.
    number : int
        Mutants that are drawn.
    without : tuple of str
        Files among them that are none of this kind.
    tests : callable
        Arguments of pytest by the mutated file: the ledger's and others.
    """

    globs: tuple[str, ...]
    number: int
    tests: Callable[[str], list[str]]
    without: tuple[str, ...] = ()

    def paths(self) -> list[str]:
        """The files."""
        found = {path for glob in self.globs for path in ROOT.glob(glob) if path.stem not in self.without}
        return sorted(path.relative_to(ROOT).as_posix() for path in found)


def _named(path: str) -> list[str]:
    """Test files that bear the name of a module, or speak of it."""
    module = Path(path).stem
    dotted = path.removesuffix(".py").replace("/", ".")
    return _tests(lambda file, text: module in file.stem or f"{dotted} " in text or f"{dotted}\n" in text)


def _tests(fits: Callable[[Path, str], bool]) -> list[str]:
    """Test files that fit."""
    files = [file for file in sorted((ROOT / "tests").glob("test_*.py")) if "packaging" not in file.name]
    return [file.relative_to(ROOT).as_posix() for file in files if fits(file, file.read_text())]


def _ledger(*pipelines: str) -> list[str]:
    return [f"{LEDGER}::test_counts_and_prices_of_small_frames_are_those_of_the_ledger[{name}]" for name in pipelines]


def _of_mix(path: str) -> list[str]:
    return _ledger(Path(path).parent.name)


def _of_stage(path: str) -> list[str]:
    folder = Path(path).parent.name
    pipelines = STAGES.get(folder, pipeline_names())
    beside = _tests(lambda file, text: f"stages.{folder}" in text and file.stem not in SLOW)
    return [*_ledger(*pipelines), *dict.fromkeys([*_named(path), *beside, *PIPELINE_TESTS.get(folder, ())])]


def _of_models(path: str) -> list[str]:
    by_hand = ["tests/test_prices_by_hand.py", "tests/test_bounds.py", "tests/test_machines.py"]
    return [
        *dict.fromkeys([*_named(path), *by_hand]),
        *_ledger("freepipe", "micropolygon", "binned", "hardware", "cudaraster", "tiled"),
    ]


def _of_machine(path: str) -> list[str]:
    return [
        *_ledger("micropolygon", "cudaraster", "hardware", "freepipe", "binned"),
        *_named(path),
        "tests/test_machines.py",
        "tests/test_occupancy.py",
    ]


def _of_report(path: str) -> list[str]:
    return list(dict.fromkeys(["tests/test_known_errors.py", "tests/test_results.py", *_named(path)]))


ROOMS = {
    "rules": Room(("models/*.py",), 90, _of_models, PLUMBING),
    "counters": Room(("simulator/stages/*/*.py", "simulator/stages/*.py"), 70, _of_stage),
    "prices": Room(("simulator/mixes/*/*.toml",), 40, _of_mix),
    "machines": Room(
        tuple(f"models/machines/{name}.toml" for name in ("gtx280", "gtx480", "gtx680", "h200")), 20, _of_machine
    ),
    "drivers": Room(("simulator/stages/*/*.py", "simulator/*.py"), 40, _of_stage),
    "reports": Room(
        ("experiments/harness/*.py", "experiments/commands/reproduce.py", "reports/page.py"), 30, _of_report
    ),
}
