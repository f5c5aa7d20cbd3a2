"""Where in a study something is wrong: the place is a path of keys, which a file turns into a line."""

import re

import msgspec

from tilestamp.models.errors import TilestampError

Place = tuple[str, ...]
HEADER = re.compile(r"\s*\[\s*(.+?)\s*\]\s*(#.*)?$")
KEY = re.compile(r"""\s*((?:"[^"]*"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[\w-]+))*)\s*=""")
PART = re.compile(r"""\s*(?:"([^"]*)"|'([^']*)'|([\w-]+))\s*\.?""")


class StudyError(TilestampError):
    """Bad input, and its place in the study."""

    def __init__(self, place: Place, sentence: str) -> None:
        self.place = place
        self.sentence = sentence
        super().__init__(f"{'.'.join(place)}: {sentence}" if place else sentence)


def refused(error: msgspec.ValidationError) -> tuple[Place, str]:
    """What msgspec refuses: the path of its key, and why."""
    message, _, where = str(error).replace("`", "").partition(" - at $")
    return tuple(key for key in where.split(".") if key), message[:1].lower() + message[1:]


class place:  # noqa: N801 - a context, as contextlib's own; a generator would take three times as long
    """Say where it stands, if something is wrong meanwhile."""

    def __init__(self, *keys: str) -> None:
        self._keys = keys

    def __enter__(self) -> None:
        """Nothing is wrong yet."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Give an error without a place this one."""
        if isinstance(error, TilestampError) and not isinstance(error, StudyError):
            raise StudyError(self._keys, str(error)) from error


def line_of(text: str, keys: Place) -> int:
    """Line of a TOML text, from 1, where the key at the end of a path stands; of what holds it, where it is not found.

    A key inside an inline table or a list has the line where that begins.
    """
    best, found = 0, 1
    table: Place = ()
    for number, line in enumerate(text.splitlines(), 1):
        if header := HEADER.match(line):
            table = here = _parts(header[1].strip("[]"))
        elif key := KEY.match(line):
            here = table + _parts(key[1])
        else:
            continue
        if len(here) > best and here == keys[: len(here)]:
            best, found = len(here), number
    return found


def _parts(dotted: str) -> Place:
    """Take ``grid."sm.count"`` apart."""
    return tuple("".join(groups) for groups in PART.findall(dotted))
