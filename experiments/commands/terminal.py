"""What the commands share on a terminal: progress on standard error."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tilestamp.experiments.harness.telling import so_far
from tilestamp.models.compile_cache import on_compiling

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status


@contextmanager
def progress(text: str) -> Iterator["Progress"]:
    """Show on standard error what is being done, how far it is, and what is being compiled meanwhile."""
    from rich.console import Console

    console = Console(stderr=True)
    spinner = "dots" if console.encoding.startswith("utf") else "line"
    with console.status(text, spinner=spinner) as status:
        said = Progress(console, status, text)
        on_compiling(said.compiling)
        try:
            yield said
        finally:
            on_compiling(None)


class Progress:
    """Call it with what is being done now: shown in place on a terminal, and nowhere else."""

    def __init__(self, console: "Console", status: "Status", text: str) -> None:
        self._console = console
        self._status = status
        self._text = text
        self._count = ""
        self._begin = time.perf_counter()
        self._told = ""

    def __call__(self, text: str) -> None:
        """Say what is being done."""
        self._text = text
        self._show(text)

    def count(self, done: int, total: int) -> None:
        """Say how many are done of how many, and from these how long the others take."""
        self._count = f"{so_far(done, total, time.perf_counter() - self._begin)}: "
        self._show(self._text)

    def compiling(self, kernel: str) -> None:
        """Say that a kernel is being compiled, or with no name that none is; elsewhere once for all that follows."""
        if not kernel:
            self._show(self._text)
        elif self._console.is_terminal:
            self._show(f"{self._text}: compiling {kernel} (first run only)")
        elif self._told != self._text:
            self._told = self._text
            line = f"{self._text}: compiling kernels (first run only)"
            self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def _show(self, text: str) -> None:
        from rich.text import Text

        self._status.update(Text(self._count + text))

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Show nothing meanwhile: rich sends to standard error what is printed beside a line in place."""
        self._status.stop()
        yield
        self._status.start()
