"""Sources that matter: the modules that a pipeline reaches by imports, and the data beside them.

An edit elsewhere (another pipeline, a report, an experiment) makes no stored cell stale.
"""

import hashlib
import re
from functools import cache
from pathlib import Path

import tilestamp
from tilestamp.simulator.manifest import DIGITS

ROOT = Path(tilestamp.__file__).parent
IMPORT = re.compile(r"^\s*(?:from (tilestamp[\w.]*) import (\([^)]*\)|[^\n(]*)|import (tilestamp[\w.]*))", re.MULTILINE)
STARTS = ("tilestamp.simulator.simulation", "tilestamp.simulator.run")


@cache
def sources_digest(pipeline: str) -> str:
    """Digest of the sources that decide what a pipeline does and costs, 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(reached(f"tilestamp.simulator.pipelines.{pipeline.replace('-', '_')}", *STARTS)):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:DIGITS]


def reached(*modules: str) -> set[Path]:
    """Files of the modules that some modules import, directly or not, with their data tables.

    What the simulator draws a run with (``reports``) decides nothing of it.
    """
    found: set[Path] = set()
    left = list(modules)
    while left:
        path = _file(left.pop())
        if path is None or path in found:
            continue
        found |= {path, *path.parent.glob("data/*.toml")}
        draws = path.relative_to(ROOT).parts[0] == "simulator"
        left += [name for name in _imports(path) if not (draws and name.startswith("tilestamp.reports"))]
    return found


@cache
def _imports(path: Path) -> list[str]:
    """Names of all that a file imports of ours: modules, and what may be one."""
    names: list[str] = []
    for package, imported, module in IMPORT.findall(path.read_text("utf-8")):
        names.append(package or module)
        names += [f"{package}.{name}" for name in re.findall(r"\w+", imported.partition("#")[0])] if package else []
    return names


@cache
def _file(module: str) -> Path | None:
    """File of a module of ours, if it is one; the package's front names all floors, and decides nothing."""
    if module == "tilestamp":
        return None
    place = ROOT.joinpath(*module.split(".")[1:])
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return path
    return None
