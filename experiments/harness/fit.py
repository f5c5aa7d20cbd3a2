"""How fitted each cell is: every fitted number of its frame is moved by a hundredth, and what follows is measured.

An experiment is run again for each number that it used and that was fitted on the frame of one of its cells. Nothing is
executed again for a price; for a chosen input (a camera's distance) the frames that it was chosen on are. A cell's
``share`` is the part of such a change that it follows. A chosen input settles the work of a frame: all of a count, but
of a time half, for the price of that work is still a prediction. Then a cell is

- ``predicted`` up to a share of ``PREDICTED``: numbers that were fitted on other frames leave it so;
- ``fitted`` from ``FITTED_FROM`` on, and wherever a number was fitted to this very cell;
- ``partly fitted`` between;
- ``stand-in``, whatever it follows, where its frame, or that of a cell that it is made of, shows the stand-in for a
  model that is not here (the first word of the frame): it says nothing of the model, and nothing of the machine.

A word (an order, a winner) is as fitted as the most fitted of the cells that it is made of, and a number that is
another cell's again as that cell.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace

from tilestamp.experiments.harness.registry import Experiment, Progress
from tilestamp.experiments.harness.result import Cell, Result, Status
from tilestamp.models.fitted import STEP, moving, names_cell, on_frame
from tilestamp.models.used import CHOSEN, FITTED, Used, collect
from tilestamp.simulator.scenes.library import STAND_INS

PREDICTED, FITTED_FROM = 0.1, 0.9
WORK_OF_A_TIME = 0.5  # part of a time that a chosen input settles
STATED = {"reported", "reproduced", "stand-in"}  # by an experiment itself
NAMED = 0.005  # smaller parts are not named
Parts = dict[str, float]
"""Of a change of a number, by its name, the part that a cell follows."""


def run_judged(experiment: Experiment, progress: Progress) -> tuple[Result, Used]:
    """Run an experiment and say of each cell how fitted it is; give what the experiment used, too."""
    with collect() as used:
        result = experiment(progress)
    return judged(result, used, experiment), used


def judged(result: Result, used: Used, experiment: Experiment) -> Result:
    """Say of each cell of a result how fitted it is.

    Parameters
    ----------
    result : Result
    used : dict
        What the experiment used (``tilestamp.models.used.collect``).
    experiment : callable
        Gives the same cells in the same order whenever it is called.
    """
    prices, inputs = used.get(FITTED, {}), used.get(CHOSEN, {})
    by_price, by_input = _parts(result, prices, experiment), _parts(result, inputs, experiment)
    targets = [target for numbers in (prices, inputs) for cells in numbers.values() for target in cells]
    cells = [
        _judged(cell, result.name, targets, price, work)
        for cell, price, work in zip(result.cells, by_price, by_input, strict=True)
    ]
    cells = [_repeated(cell, cells) for cell in cells]
    return replace(result, cells=_stand_ins_marked(cells, used.get(STAND_INS, {}).keys()))


def _parts(result: Result, numbers: Mapping[str, set[str]], experiment: Experiment) -> list[Parts]:
    """What each cell follows of each number that was fitted on its frame."""
    found: list[Parts] = [{} for _ in result.cells]
    parts_of_others = {place for cell in result.cells for place in cell.of}
    wanted = [c.status not in STATED or (c.row, c.column) in parts_of_others for c in result.cells]
    for name, targets in sorted(numbers.items()):
        frames = [
            judged and any(on_frame(target, cell.frame) for target in targets)
            for judged, cell in zip(wanted, result.cells, strict=True)
        ]
        if any(frames):
            with moving(name):
                again = experiment(lambda _: None).cells
            for parts, framed, cell, other in zip(found, frames, result.cells, again, strict=True):
                if framed:
                    parts[name] = _followed(cell, other)
    return found


def _followed(cell: Cell, other: Cell) -> float:
    """Relative change of a cell over that of the number that was moved, at most 1."""
    if isinstance(cell.ours, str) or isinstance(other.ours, str) or not cell.ours:
        return 0.0
    return min(1.0, abs(other.ours / cell.ours - 1.0) / STEP)


def _judged(cell: Cell, result: str, targets: list[str], by_price: Parts, by_input: Parts) -> Cell:
    settled = WORK_OF_A_TIME if cell.kind == "time" else 1.0
    parts = by_price | {name: settled * part for name, part in by_input.items()}
    price = min(1.0, sum(by_price.values()))
    work = settled * max(by_input.values(), default=0.0)
    share = 1.0 - (1.0 - price) * (1.0 - work)
    itself = any(names_cell(target, (cell.frame, result, cell.row, cell.column)) for target in targets)
    share = 1.0 if itself else share
    named = sorted(((name, part) for name, part in parts.items() if part >= NAMED), key=lambda part: -part[1])
    return replace(cell, status=_status(cell, share), share=share, fitted_by=tuple(named))


def _status(cell: Cell, share: float) -> Status:
    if cell.status in STATED:
        return cell.status
    if share >= FITTED_FROM:
        return "fitted"
    return "partly fitted" if share > PREDICTED else "predicted"


def _stand_ins_marked(cells: list[Cell], absent: Collection[str]) -> list[Cell]:
    """Mark the cells whose frame shows a stand-in, and those that are made of such cells."""
    drawn = {(cell.row, cell.column) for cell in cells if cell.frame.split(" ")[0] in absent}
    return [
        replace(cell, status="stand-in", share=0.0, fitted_by=())
        if drawn.intersection({(cell.row, cell.column), *cell.of})
        else cell
        for cell in cells
    ]


def _repeated(cell: Cell, cells: list[Cell]) -> Cell:
    """A word, or another cell's number again, is as fitted as the most fitted of what it is made of, and of itself."""
    made_of = [other for other in cells if (other.row, other.column) in cell.of]
    if not made_of or not (isinstance(cell.ours, str) or [other.ours for other in made_of] == [cell.ours]):
        return cell
    most = max([cell, *made_of], key=lambda other: other.share)
    return replace(cell, status=_status(cell, most.share), share=most.share, fitted_by=most.fitted_by)
