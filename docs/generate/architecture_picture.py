"""The architecture picture: Mermaid is what code hosts draw; the site shows floors, rooms and a table of imports."""

import re
from html import escape

from texts import table

MERMAID = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def drawn(markdown: str) -> str:
    """Replace flow charts of subgraphs."""
    return MERMAID.sub(lambda found: _floors(found[1]), markdown)


def _floors(chart: str) -> str:
    bands, names = [], dict[str, str]()
    for floor, body in re.findall(r"subgraph \w+\[([^\]]+)\]\n(.*?)\n  end", chart, re.DOTALL):
        rooms = dict(re.findall(r"^ +(\w+)\[(.+)\]$", body, re.MULTILINE))
        names |= {key: floor if label.endswith("modules") else f"{floor}.{label}" for key, label in rooms.items()}
        boxes = "".join(f"<li>{escape(label)}</li>" for label in rooms.values())
        bands.append(f'<div class="floor"><b>{escape(floor)}</b><ul>{boxes}</ul></div>')
    imports: dict[str, list[str]] = {}
    for source, target in re.findall(r"^ +(\w+) --> (\w+)$", chart, re.MULTILINE):
        imports.setdefault(names[source], []).append(names[target])
    rows = [(source, ", ".join(targets)) for source, targets in imports.items()]
    return "\n".join(bands) + "\n\n" + table(["folder", "imports"], rows)
