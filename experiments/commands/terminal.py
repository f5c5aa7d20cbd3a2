"""What the commands share on a terminal: progress on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.status import Status

from tilestamp.models.compile_cache import on_compiling
from tilestamp.models.errors import TilestampError


@contextmanager
def writing(path: Path, flag: str = "-o") -> Iterator[None]:
    """Say in a sentence why a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise TilestampError(f"{flag} {path}: cannot be written ({error.strerror or error})") from error


@contextmanager
def progress(text: str) -> Iterator["Progress"]:
    """Show what is being done on standard error, and which kernels are being compiled meanwhile."""
    console = Console(stderr=True)
    with console.status(text) as status:
        said = Progress(console, status, text)
        on_compiling(said.compiling)
        yield said


class Progress:
    """Call it with what is being done now."""

    def __init__(self, console: Console, status: Status, text: str) -> None:
        self._console = console
        self._status = status
        self._text = text
        self._compiled = 0

    def compiling(self, kernel: str) -> None:
        """Say that a kernel is being compiled: each in place on a terminal, elsewhere only the first."""
        self._compiled += 1
        if self._console.is_terminal:
            self._status.update(f"{self._text}: compiling {kernel}, once (kernel {self._compiled})")
        elif self._compiled == 1:
            self._console.print("compiling kernels: only the first time, a minute or two")

    def __call__(self, text: str) -> None:
        """Say what is being done: in place on a terminal, a line each elsewhere."""
        self._text = text
        if self._console.is_terminal:
            self._status.update(text)
        else:
            self._console.print(text)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Show nothing meanwhile: rich sends to standard error what is printed beside a line in place."""
        self._status.stop()
        yield
        self._status.start()
