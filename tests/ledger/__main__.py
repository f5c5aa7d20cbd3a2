"""``python -m tests.ledger [--cells [EXPERIMENT ...]]``: write the ledger of the frames, or that of experiments' cells.

``python -m tests.ledger && python -m tests.ledger --cells`` writes all of it (ten minutes).
"""

import os
import sys

from tests.conftest import SCENES_VARIABLE, real_scenes
from tests.ledger import book, cells, runs
from tilestamp.simulator.pipelines import pipeline_names


def main() -> None:
    """Write files anew, and say what changed."""
    if "--cells" not in sys.argv[1:]:
        for pipeline in pipeline_names():
            _renew("frames", pipeline, ("frame", "kernel", "quantity", "value"), runs.entries(pipeline))
        return
    if real_scenes():
        os.environ.setdefault(SCENES_VARIABLE, real_scenes())
    for name in [name for name in sys.argv[1:] if name != "--cells"] or cells.experiments():
        _renew("cells", cells.file_name(name), cells.HEADER, cells.entries(name))


def _renew(folder: str, name: str, header: tuple[str, ...], entries: book.Entries) -> None:
    path = book.FOLDER / folder / f"{name}.csv"
    changed = book.differences(book.read(path), entries) if path.exists() else []
    book.write(path, header, entries)
    sys.stdout.write(f"{folder}/{name}: {len(entries)} numbers, {len(changed)} changed\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
