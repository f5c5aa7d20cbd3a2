"""The API reference: the public names, then a page for each folder of modules."""

import inspect
from pathlib import Path

from texts import code, sections, table

import tilestamp

PACKAGE = Path(tilestamp.__file__).parent
FLOORS = ("models", "simulator", "experiments", "reports")


def pages() -> dict[str, str | bytes]:
    """Pages of directives that mkdocstrings fills from the docstrings."""
    homes = {name: getattr(tilestamp, name) for name in tilestamp.__all__}
    rows = [[f"[`{name}`][{value.__module__}.{name}]", _first(value)] for name, value in homes.items()]
    public = table(["name", "what it is"], rows)
    made: dict[str, str | bytes] = {"api/index.md": f"# Reference\n\n`from tilestamp import ...`:\n\n{public}"}
    for floor in FLOORS:
        for folder in sorted({path.parent for path in (PACKAGE / floor).rglob("*.py")}):
            made |= _page(folder)
    return made


def _first(value: object) -> str:
    """First line of a docstring."""
    return code((inspect.getdoc(value) or "").split("\n")[0])


def _page(folder: Path) -> dict[str, str | bytes]:
    modules = [path.stem for path in sorted(folder.glob("[a-z]*.py"))]
    name = ".".join(folder.relative_to(PACKAGE).parts)
    if not modules:
        return {}
    about = sections((folder / "__init__.py").read_text("utf-8").split('"""')[1])[""] if _has_text(folder) else ""
    directives = "\n".join(f"::: tilestamp.{name}.{module}\n" for module in modules)
    return {f"api/{name}.md": f"# {name}\n\n{about}\n\n{directives}"}


def _has_text(folder: Path) -> bool:
    init = folder / "__init__.py"
    return init.is_file() and '"""' in init.read_text("utf-8")
