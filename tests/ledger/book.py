"""The files of the ledger: how they are written, and how they are compared."""

import csv
from pathlib import Path

FOLDER = Path(__file__).parent
TIME_TOLERANCE = 1e-3  # relative, of a time; counts are compared exactly
PRICE_TOLERANCE = 1e-9  # of what a mix makes of counts: sums of floats
Entries = dict[tuple[str, ...], str]


def write(path: Path, header: tuple[str, ...], entries: Entries) -> None:
    """Write entries as CSV: a line a number, so that a diff reads."""
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(header)
        lines.writerows([*key, value] for key, value in entries.items())


def read(path: Path) -> Entries:
    """Read what ``write`` wrote."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return {tuple(row[:-1]): row[-1] for row in rows}


def differences(held: Entries, made: Entries) -> list[str]:
    """Sentences on what differs between the ledger and what was made now."""
    found = [f"{' / '.join(key)}: no longer there" for key in held if key not in made]
    found += [f"{' / '.join(key)}: new, {made[key]}" for key in made if key not in held]
    for key in held.keys() & made.keys():
        if not alike(key, held[key], made[key]):
            found.append(f"{' / '.join(key)}: {held[key]} -> {made[key]}{_change(held[key], made[key])}")
    return sorted(found)


def alike(key: tuple[str, ...], held: str, made: str) -> bool:
    """Whether two values are the same number, as far as that kind of number goes."""
    if held == made:
        return True
    tolerance = tolerance_of(key[-1])
    try:
        a, b = float(held), float(made)
    except ValueError:
        return False
    return abs(a - b) <= tolerance * max(abs(a), abs(b))


def tolerance_of(quantity: str) -> float:
    """Relative tolerance of a quantity by its name."""
    if quantity.startswith("count"):
        return 0.0
    return TIME_TOLERANCE if quantity.startswith(("time", "ours")) else PRICE_TOLERANCE


def _change(held: str, made: str) -> str:
    try:
        return f" ({100 * (float(made) / float(held) - 1):+.3g} %)"
    except (ValueError, ZeroDivisionError):
        return ""
