"""What a command is to write: refused before anything is computed, where it could not be; JSON."""

import json
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_folder


def check_png(output: Path | None, flag: str = "-o") -> None:
    """Refuse a picture that could not be written."""
    if output is not None:
        check_file(output, flag, ".png")


def check_file(output: Path, flag: str, *endings: str) -> None:
    """Refuse a file that could not be written."""
    if not output.name.lower().endswith(endings):
        raise TilestampError(f"{flag} {output}: should end in {' or '.join(endings)}")
    if not is_folder(output.parent):
        raise TilestampError(f"{flag} {output}: there is no folder {output.parent}")
    if is_folder(output):
        raise TilestampError(f"{flag} {output}: is a folder")
    if not os.access(output.parent, os.W_OK):
        raise TilestampError(f"{flag} {output}: the folder {output.parent} cannot be written to")


@contextmanager
def writing(path: Path, flag: str = "-o") -> Iterator[Path]:
    """Give a path to write to, which becomes the file in the end, all of it or nothing; say why where it cannot."""
    partial = path.with_name(f"partial.{path.name}")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        raise TilestampError(f"{flag} {path}: cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):
            partial.unlink()


def write_json(value: object) -> None:
    """Print a value as a line of JSON: NumPy's scalars are plain numbers, and what is no finite number is null."""
    sys.stdout.write(json.dumps(_plain(value), allow_nan=False) + "\n")


def _plain(value: object) -> object:
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
