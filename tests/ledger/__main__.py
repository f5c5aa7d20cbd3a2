"""``python -m tests.ledger [--cells]``: write the ledger of the frames; with ``--cells`` that of experiments too."""

import sys

from tests.ledger import book, cells, frames
from tilestamp.experiments.harness.registry import experiment_names
from tilestamp.simulator.pipelines import pipeline_names


def main() -> None:
    """Write all files anew, and say what changed."""
    for pipeline in pipeline_names():
        _renew("frames", pipeline, ("frame", "kernel", "quantity", "value"), frames.entries(pipeline))
    if "--cells" in sys.argv[1:]:
        for name in experiment_names():
            _renew("cells", name.replace("/", "-"), cells.HEADER, cells.entries(name))


def _renew(folder: str, name: str, header: tuple[str, ...], entries: book.Entries) -> None:
    path = book.FOLDER / folder / f"{name}.csv"
    changed = book.differences(book.read(path), entries) if path.exists() else []
    book.write(path, header, entries)
    sys.stdout.write(f"{folder}/{name}: {len(entries)} numbers, {len(changed)} changed\n")


main()
