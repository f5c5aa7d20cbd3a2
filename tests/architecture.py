"""The architecture picture, drawn from the imports; ``python -m tests.architecture`` draws it in docs/architecture.md.

A box is a room (a folder of modules, or a floor's own modules), an arrow an import between rooms; an arrow that follows
from others is left out.
"""

from collections import defaultdict
from pathlib import Path

import grimp

PAGE = Path(__file__).parent.parent / "docs" / "architecture.md"
FLOORS = ("experiments", "reports", "simulator", "models")
BEGIN, END = "```mermaid\n", "```\n"
ROOMS = {"simulator.stages"}  # folders whose own folders are rooms


def rooms() -> dict[str, set[str]]:
    """The rooms that each room imports."""
    graph = grimp.build_graph("tilestamp")
    arrows: dict[str, set[str]] = defaultdict(set)
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            source, target = room(module), room(imported)
            if source and target and source != target:
                arrows[source].add(target)
                arrows.setdefault(target, set())
    return dict(arrows)


def room(module: str) -> str:
    """Room of a module: ``tilestamp.simulator.stages.laine2011.clipper`` stands in ``simulator.stages.laine2011``."""
    parts = module.split(".")[1:]
    if not parts or parts[0] not in FLOORS:
        return ""
    folder = Path(__file__).parent.parent
    depth = 1
    while depth < len(parts) and folder.joinpath(*parts[: depth + 1]).is_dir() and _is_room(parts[: depth + 1]):
        depth += 1
    return ".".join(parts[:depth])


def _is_room(parts: list[str]) -> bool:
    return len(parts) == 2 or ".".join(parts[:-1]) in ROOMS


def reduced(arrows: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Arrows that do not follow from others; those of a circle all stay."""
    left = [
        (source, target)
        for source, targets in arrows.items()
        for target in targets
        if not any(target in _reached(arrows, other, {source}) for other in targets - {target})
    ]
    return sorted(left)


def _reached(arrows: dict[str, set[str]], start: str, without: set[str]) -> set[str]:
    found, todo = set(), [start]
    while todo:
        for target in arrows[todo.pop()] - found - without:
            found.add(target)
            todo.append(target)
    return found


def picture() -> str:
    """The picture as Mermaid, which code hosts draw."""
    arrows = rooms()
    lines = ["flowchart TD"]
    for floor in FLOORS:
        members = sorted(name for name in arrows if name.split(".")[0] == floor)
        lines += [
            f"  subgraph {floor}_floor[{floor}]",
            *(f"    {_id(name)}[{_label(name)}]" for name in members),
            "  end",
        ]
    lines += [f"  {_id(source)} --> {_id(target)}" for source, target in reduced(arrows)]
    return BEGIN + "\n".join(lines) + "\n" + END


def _id(name: str) -> str:
    return name.replace(".", "_")


def _label(name: str) -> str:
    return name.partition(".")[2] or f"{name}: modules"


def drawn() -> str:
    """The picture as it stands in the page."""
    text = PAGE.read_text("utf-8")
    begin = text.index(BEGIN)
    return text[begin : text.index(END, begin + len(BEGIN)) + len(END)]


if __name__ == "__main__":
    PAGE.write_text(PAGE.read_text("utf-8").replace(drawn(), picture()), "utf-8")
