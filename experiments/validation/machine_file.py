"""A machine file from measured numbers: what could not be measured comes from a machine near it, and says so."""

from collections.abc import Iterable

from tilestamp.experiments.validation.gpu import BUSY
from tilestamp.experiments.validation.measuring import Number
from tilestamp.models.machine import SECTIONS, Machine


def machine_file(numbers: Iterable[Number], base: Machine, name: str, description: str, capability: str) -> str:
    """TOML text.

    Parameters
    ----------
    numbers : iterable of Number
    base : Machine
        Where the numbers that no micro-benchmark gives come from.
    name, description, capability : str
    """
    measured = {number.key: number for number in numbers}
    lines = [f"# {description}", '# Written by tilestamp measure-machine; "measured" numbers are medians.', ""]
    lines += [
        "[identity]",
        f'name = "{name}"',
        f'description = "{description}"',
        f'compute_capability = "{capability}"',
    ]
    for section, struct in SECTIONS.items():
        part = getattr(base, section)
        if section in ("identity", "fixed_function") or part is None:
            continue
        lines += ["", f"[{section}]"]
        for key in struct.__struct_fields__:
            lines.append(_line(key, getattr(part, key), measured.get(f"{section}.{key}"), base, f"{section}.{key}"))
    return "\n".join(lines) + "\n"


def _line(key: str, value: object, number: Number | None, base: Machine, name: str) -> str:
    """One number with its provenance."""
    if number is None:
        kind = "published" if base.provenance.get(name, ("assumed", ""))[0] == "published" else "assumed"
        return f'{key} = {{ value = {_text(value)}, provenance = "{kind}", source = "as {base.name}: not measured" }}'
    found = round(number.value) if isinstance(value, int) else float(f"{number.value:.4g}")
    if key == "dram_gb_per_s":
        found = float(f"{number.value / base.memory.dram_efficiency:.4g}")
    source = f"tilestamp measure-machine: {number.how}; spread {100 * number.spread:.1f} %"
    return f'{key} = {{ value = {_text(found)}, provenance = "measured", source = "{source}" }}'


def _text(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def busy(numbers: Iterable[Number]) -> list[str]:
    """Keys of numbers whose repeats disagree: something else runs on the GPU."""
    return [number.key for number in numbers if number.spread > BUSY]
