"""A machine: one GPU as numbers, each with its provenance.

A machine file (``models/machines/NAME.toml``, or the user's own) has the sections below. Every number in it is
written ``key = { value = 30, provenance = "published", source = "where from" }``, a fitted one with the cells that it
was ``fitted_to`` (``tilestamp.models.fitted``); ``load_machine`` hands out plain numbers (``machine.sm.count``) and
keeps where each came from in ``machine.provenance["sm.count"]``.
Cycles are those of ``sm.clock_mhz``, the clock at which instructions issue (the shader clock up to Fermi).
"""

import hashlib
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import msgspec
import msgspec.structs

from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import Fitted
from tilestamp.models.machine_numbers import plain_number, refusal, same_lanes, whole_numbers
from tilestamp.models.machine_parts import Atomics, FixedFunction, Identity, Issue, Latency, Launching, Memory, Pipe, Sm
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.models.paths import is_file
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.models.used import collecting, note

FOLDER = Path(__file__).parent / "machines"
Provenance = Literal["published", "measured", "derived", "fitted", "assumed"]


class Machine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One GPU."""

    identity: Identity
    sm: Sm
    issue: Issue
    pipe: Pipe
    latency: Latency
    memory: Memory
    atomics: Atomics
    launch: Launching
    fixed_function: FixedFunction | None
    provenance: dict[str, tuple[Provenance, str]]  # "sm.count" -> kind, source
    digest: str  # of the numbers, for manifests
    fitted_to: dict[str, tuple[str, ...]] = {}  # "atomics.conflict_ns" -> the cells that it was fitted to
    changes: dict[str, tuple[Any, Any]] = {}  # "sm.count" -> before, after; of a machine that was altered
    file: str = ""  # of a machine that is not the package's, although it bears its name

    @property
    def name(self) -> str:
        """Name of the machine, with what makes it another one: ``gtx280 (sm.count=60)``."""
        marks = [self.file] * bool(self.file) + [f"{key}={value}" for key, (_, value) in self.changes.items()]
        return f"{self.identity.name} ({', '.join(marks)})" if marks else self.identity.name

    @property
    def compute_capability(self) -> str:
        """Such as ``"1.3"``."""
        return self.identity.compute_capability

    @property
    def simt(self) -> Simt:
        """The part that counting depends on."""
        return Simt(
            warp=self.sm.warp_size,
            coalescing=int(Coalescing[self.memory.coalescing.upper()]),
            banks=self.memory.banks,
            bank_lanes=self.memory.bank_lanes,
            atomic_merge=int(AtomicMerge[self.atomics.merge.upper()]),
            sms=self.sm.count,
            bank_bytes=self.memory.bank_bytes,
            bank_mode_bytes=self.memory.bank_mode_bytes,
        )

    @property
    def as_moved(self) -> "Machine":
        """The machine with the number that is moved now; every price is made on this one."""
        fitted = [
            Fitted(f"{self.identity.name}: {key}", float(self.number(key)), to) for key, to in self.fitted_to.items()
        ]
        values = {number.name.split(": ")[1]: number.value for number in fitted if number.value != number.number}
        return altered(self, values, "fitted", "moved") if values else self

    def number(self, key: str) -> Any:
        """Value by its name in ``provenance``, such as ``"sm.count"``."""
        *path, last = key.split(".")
        part: Any = self
        for step in path:
            part = getattr(part, step)
        return part[last] if isinstance(part, dict) else getattr(part, last)

    @property
    def clock_hz(self) -> float:
        """Issue clock in Hz."""
        return self.sm.clock_mhz * 1e6

    @property
    def dram_bytes_per_cycle(self) -> float:
        """Sustained DRAM bytes in a cycle of the issue clock."""
        return self.memory.dram_gb_per_s * 1e9 * self.memory.dram_efficiency / self.clock_hz


SECTIONS: dict[str, type[msgspec.Struct]] = {
    "identity": Identity,
    "sm": Sm,
    "issue": Issue,
    "pipe": Pipe,
    "latency": Latency,
    "memory": Memory,
    "atomics": Atomics,
    "launch": Launching,
    "fixed_function": FixedFunction,
}


def list_machines() -> dict[str, str]:
    """Machines that come with the package: name and a line of what each is."""
    files = sorted(FOLDER.glob("*.toml"))
    return {file.stem: tomllib.loads(file.read_text("utf-8"))["identity"]["description"] for file in files}


def load_machine(name_or_path: str | Path | Machine) -> Machine:
    """Read a machine by its name, or from a file of the user's; a Machine is given back.

    Raises
    ------
    TilestampError
        No such machine or file; a key that is unknown, missing or out of range; numbers that contradict each other.
    """
    if isinstance(name_or_path, Machine):
        return name_or_path
    if not isinstance(name_or_path, str | Path):
        raise TilestampError(f"a machine is a Machine, a name or a machine file, not {name_or_path!r}")
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = FOLDER / f"{name_or_path}.toml"
        if not is_file(path):
            known, word = list(list_machines()), str(name_or_path)
            raise TilestampError(f"no machine {word!r}{did_you_mean(word.lower(), known)}; known: {', '.join(known)}")
    if not is_file(path):
        raise TilestampError(f"there is no machine file {path}")
    machine = _shipped(path, path.stat().st_mtime_ns) if path.parent == FOLDER else _read(path)
    shipped = FOLDER / f"{machine.name}.toml"
    if is_file(shipped) and not shipped.samefile(path) and load_machine(machine.name).digest != machine.digest:
        machine = msgspec.structs.replace(machine, file=f"{path.name}, digest {machine.digest}")
    note_machine(machine)
    return machine


@lru_cache(64)
def _shipped(path: Path, _modified: int) -> Machine:
    return _read(path)


def _read(path: Path) -> Machine:
    """Read a machine file."""
    try:
        table = tomllib.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise TilestampError(f"cannot read the machine file {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # no TOML or no text
        raise TilestampError(f"{path} is not a TOML file: {error}") from error
    return _build(table, str(path))


def altered(
    machine: Machine, values: Mapping[str, Any], provenance: Provenance = "assumed", source: str = "a what-if"
) -> Machine:
    """Return the machine with other numbers: a what-if, or a fit.

    Parameters
    ----------
    machine : Machine
    values : mapping
        Such as ``{"sm.clock_mhz": 1500.0}``; numbers of NumPy will do. What scales with what:
        ``models.machine_parts``. Cycles of an instruction are those of a whole warp, so another ``sm.warp_size``
        changes those that are not given too: lanes a clock stay, and no instruction issues in less than a clock.
    provenance, source : str
        What the new numbers are, and where they come from.
    """
    table: dict[str, Any] = {}  # sections that change
    changes = dict(machine.changes)
    values = same_lanes(machine.sm.warp_size, machine.issue, machine.pipe, values) | {
        key: plain_number(value) for key, value in values.items()
    }
    for key, value in values.items():
        *path, last = str(key).split(".")
        if path and path[0] in SECTIONS and path[0] not in table:
            table[path[0]] = msgspec.to_builtins(getattr(machine, path[0]))
        section: Any = table
        for step in path:
            section = section.get(step) if isinstance(section, dict) else None
        if not isinstance(section, dict) or isinstance(section.get(last, {}), dict):
            raise TilestampError(f"{key!r} is no number of a machine{did_you_mean(str(key), list(machine.provenance))}")
        before = changes.pop(key, (section[last],))[0]
        section[last] = value
        if value != before:
            changes[key] = before, value
    sections = {name: table.get(name) or getattr(machine, name) for name in SECTIONS}
    sections = {name: section for name, section in sections.items() if section is not None}
    origins = machine.provenance | dict.fromkeys(values, (provenance, source))
    fitted_to = {key: cells for key, cells in machine.fitted_to.items() if key not in values}
    marks = {"changes": changes, "file": machine.file, "fitted_to": fitted_to}
    changed = msgspec.structs.replace(_convert(sections, origins, machine.name), **marks)
    note_machine(changed)
    return changed


def note_machine(machine: Machine) -> None:
    """Note that a machine is used: its name is only put together where somebody collects."""
    if collecting():
        note("machines", machine.name, machine.digest)


def _build(table: dict[str, Any], file: str) -> Machine:
    """Take values and provenance apart, and convert."""
    _check_keys(table, list(SECTIONS), {"fixed_function"}, "section", file)
    sections: dict[str, Any] = {}
    origins: dict[str, tuple[Provenance, str]] = {}
    fitted_to: dict[str, tuple[str, ...]] = {}
    for name, struct in SECTIONS.items():
        if name not in table:
            continue
        optional = {field.name for field in msgspec.structs.fields(struct) if not field.required}
        _check_keys(table[name], list(struct.__struct_fields__), optional, f"key of [{name}]", file)
        sections[name] = table[name] if name == "identity" else _plain(table[name], name, origins, fitted_to, file)
    return msgspec.structs.replace(_convert(sections, origins, file), fitted_to=fitted_to)


def _plain(
    table: dict[str, Any],
    prefix: str,
    origins: dict[str, tuple[Provenance, str]],
    fitted_to: dict[str, tuple[str, ...]],
    file: str,
) -> dict[str, Any]:
    """Values of a section; their provenance goes to ``origins``, the cells of fitted ones to ``fitted_to``."""
    values: dict[str, Any] = {}
    for key, entry in table.items():
        name = f"{prefix}.{key}"
        if isinstance(entry, dict) and "value" not in entry and key == "per_clock":
            values[key] = _plain(entry, name, origins, fitted_to, file)
            continue
        if not isinstance(entry, dict) or entry.keys() - {"fitted_to"} != {"value", "provenance", "source"}:
            raise TilestampError(f"{file}: {name} must be written {{ value = ..., provenance = ..., source = ... }}")
        if (entry["provenance"] == "fitted") != ("fitted_to" in entry):
            raise TilestampError(f"{file}: {name} must say what it was fitted_to if it is fitted, and only then")
        if entry["provenance"] not in get_args(Provenance):
            raise TilestampError(f"{file}: {name} has the unknown provenance {entry['provenance']!r}")
        values[key] = entry["value"]
        origins[name] = (entry["provenance"], str(entry["source"]))
        if "fitted_to" in entry:
            fitted_to[name] = tuple(map(str, entry["fitted_to"]))
    return values


def _convert(sections: dict[str, Any], origins: dict[str, tuple[Provenance, str]], file: str) -> Machine:
    """Make a machine of its sections: tables, and those of another machine as they are there."""
    tables = {
        name: whole_numbers(values, SECTIONS[name]) for name, values in sections.items() if isinstance(values, dict)
    }
    sections = sections | tables
    try:
        machine = msgspec.convert({"fixed_function": None, "provenance": {}, "digest": ""} | sections, Machine)
    except msgspec.ValidationError as error:
        raise TilestampError(f"{file}: {refusal(str(error), tables, SECTIONS)}") from error
    _check_sense(machine, file)
    numbers = msgspec.json.encode({name: _text(section) for name, section in sections.items()}, order="deterministic")
    digest = hashlib.sha256(numbers).hexdigest()[:16]
    return msgspec.structs.replace(machine, provenance=origins, digest=digest)


def _text(section: dict[str, Any] | msgspec.Struct) -> msgspec.Raw:
    """Numbers of a section, by name."""
    if isinstance(section, dict):
        return msgspec.Raw(msgspec.json.encode(section, order="deterministic"))
    return _text(msgspec.to_builtins(section)) if isinstance(section, FixedFunction) else _known_text(section)


@lru_cache(1 << 10)
def _known_text(section: msgspec.Struct) -> msgspec.Raw:
    return _text(msgspec.to_builtins(section))


def _check_keys(table: object, known: list[str], optional: set[str], what: str, file: str) -> None:
    if not isinstance(table, dict):
        raise TilestampError(f"{file}: a {what} must be a table")
    for key in table:
        if key not in known:
            raise TilestampError(f"{file}: unknown {what} {key!r}{did_you_mean(key, known)}")
    for key in known:
        if key not in table and key not in optional:
            raise TilestampError(f"{file}: missing {what} {key!r}")


def _check_sense(machine: Machine, file: str) -> None:
    """Refuse numbers that cannot all be true of one machine."""
    sm, memory = machine.sm, machine.memory
    contradictions = {
        f"{sm.max_warps} warps of {sm.warp_size} are more than the {sm.max_threads} threads of an SM": (
            sm.max_warps * sm.warp_size > sm.max_threads
        ),
        f"a block of {sm.max_threads_per_block} threads does not fit an SM of {sm.max_threads}": (
            sm.max_threads_per_block > sm.max_threads
        ),
        f"one warp at {sm.max_registers_per_thread} registers a thread does not fit {sm.registers} registers": (
            sm.max_registers_per_thread * sm.warp_size > sm.registers
        ),
        f"{memory.bank_lanes} lanes cannot access shared memory together in a warp of {sm.warp_size}": (
            memory.bank_lanes > sm.warp_size
        ),
        "warp_size may be at most 64": sm.warp_size > 64,
        f"words of {memory.bank_mode_bytes} bytes do not fit banks of {memory.bank_bytes}": (
            memory.bank_mode_bytes > memory.bank_bytes
        ),
        "an L2 without l2_bytes_per_clock or latency.l2_cycles": (
            memory.l2_bytes > 0 and (memory.l2_bytes_per_clock == 0 or machine.latency.l2_cycles == 0)
        ),
        "atomics in L2 units on a machine without L2": machine.atomics.place == "l2_unit" and memory.l2_bytes == 0,
    }
    for sentence, wrong in contradictions.items():
        if wrong:
            raise TilestampError(f"{file} contradicts itself: {sentence}")
