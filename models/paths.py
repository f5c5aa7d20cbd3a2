"""What lies at a path: nothing where no file can have such a name (too long, with a zero byte): `pathlib` raises."""

from pathlib import Path


def is_file(path: str | Path) -> bool:
    """Whether a regular file is there: no folder, no pipe."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: str | Path) -> bool:
    """Whether a folder is there."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError):
        return False
