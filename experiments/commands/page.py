"""``tilestamp page``: the page, anew from the results that lie in a folder."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.reproduce import RESULTS
from tilestamp.experiments.harness.folder import rebuild, stored
from tilestamp.models.errors import TilestampError


def page(*, output: Annotated[Path, Parameter(name=["--output", "-o"])] = RESULTS) -> None:
    """Write the page and the scoreboard anew from the results that lie in a folder; nothing is run.

    Parameters
    ----------
    output
        Folder of the results (of `tilestamp reproduce`).
    """
    if not stored(output):
        raise TilestampError(f"-o {output}: holds no results; tilestamp reproduce writes them")
    sys.stdout.write(f"The page: {rebuild(output)[2]}\n")
