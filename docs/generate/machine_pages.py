"""Machine files: a table of all, and each number of each with where it comes from."""

from collections import Counter

from texts import code, table

from tilestamp.models.machine import FOLDER, list_machines, load_machine
from tilestamp.models.machine_parts import Atomics, FixedFunction, Issue, Latency, Launching, Memory, Pipe, Sm

KINDS = ("measured", "published", "derived", "fitted", "assumed")
PARTS = {
    "sm": Sm, "issue": Issue, "pipe": Pipe, "latency": Latency, "memory": Memory, "atomics": Atomics,
    "launch": Launching, "fixed_function": FixedFunction,
}  # fmt: skip
INTRODUCTION = """# Machines

A machine is a file of numbers (`models/machines/NAME.toml`), each with its provenance: **measured** by our
micro-benchmarks, **published**, **derived** from such numbers, **fitted** to published or measured cells (which, the
file says), or **assumed**. The table counts them. Only where numbers were measured can times be trusted to per cents
([accuracy](../accuracy.md)).

```sh
tilestamp list machines
tilestamp render teapot --machine h200 --set sm.count=60      # a what-if
tilestamp measure-machine -o my-gpu.toml                      # your own GPU
```

"""


def pages() -> dict[str, str | bytes]:
    """The index, and a page for each machine."""
    names = list_machines()
    rows = [_row(name, about) for name, about in names.items()]
    index = INTRODUCTION + table(["machine", "what it is", "compute capability", "numbers"], rows)
    return {"machines/index.md": index} | {f"machines/{name}.md": _page(name) for name in names}


def _row(name: str, about: str) -> list[object]:
    machine = load_machine(name)
    counts = Counter(kind for kind, _ in machine.provenance.values())
    told = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind])
    return [f"[{name}]({name}.md)", about, machine.compute_capability, told]


def _page(name: str) -> str:
    machine = load_machine(name)
    head = [line.removeprefix("#").strip() for line in _comment((FOLDER / f"{name}.toml").read_text("utf-8"))]
    parts: dict[str, list[list[object]]] = {}
    for key, (kind, source) in machine.provenance.items():
        section, _, number = key.partition(".")
        parts.setdefault(section, []).append([f"`{number}`", machine.number(key), kind, source])
    text = f"# {name}\n\nCompute capability {machine.compute_capability}.\n\n" + "\n".join(head) + "\n"
    for section, rows in parts.items():
        about = code((PARTS[section].__doc__ or "").split("\n\n")[0]) if section in PARTS else ""
        text += f"\n## {section}\n\n{about}\n\n{table(['number', 'value', 'provenance', 'source'], rows)}"
    return text


def _comment(text: str) -> list[str]:
    """The lines of comment that a file begins with; indented ones are a list."""
    lines = text.splitlines()
    end = next(index for index, line in enumerate(lines) if not line.startswith("#"))
    return ["- " + line.removeprefix("#   ") if line.startswith("#   ") else line for line in lines[:end]]
