"""What a command is to write: refused before anything is computed, where it could not be; JSON."""

import json
import math
import os
import sys
from pathlib import Path

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_folder


def check_png(output: Path | None, flag: str = "-o") -> None:
    """Refuse a picture that could not be written."""
    if output is not None:
        check_file(output, flag, ".png")


def check_file(output: Path, flag: str, ending: str) -> None:
    """Refuse a file that could not be written."""
    if not output.name.lower().endswith(ending):
        raise TilestampError(f"{flag} {output}: is written as {ending}")
    if not is_folder(output.parent):
        raise TilestampError(f"{flag} {output}: there is no folder {output.parent}")
    if is_folder(output):
        raise TilestampError(f"{flag} {output}: is a folder")
    if not os.access(output.parent, os.W_OK):
        raise TilestampError(f"{flag} {output}: the folder {output.parent} cannot be written to")


def write_json(value: object) -> None:
    """Print a value as a line of JSON: NumPy's scalars are plain numbers, and what is no finite number is null."""
    sys.stdout.write(json.dumps(_plain(value), allow_nan=False) + "\n")


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    value = value.tolist() if hasattr(value, "tolist") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
