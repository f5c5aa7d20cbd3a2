"""What made a result: digests of the sources that it came from."""

import hashlib
from functools import cache
from pathlib import Path

import tilestamp

FLOORS = ("models", "simulator", "experiments", "reports")


@cache
def source_digest() -> str:
    """Digest of all Python sources of the package, 16 hexadecimal digits."""
    root = Path(tilestamp.__file__).resolve().parent
    digest = hashlib.sha256()
    for floor in FLOORS:
        for path in sorted((root / floor).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]
