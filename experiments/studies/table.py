"""Tidy tables: a row a cell; first its place on the axes, then its numbers."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd

PROBLEM = "problem"


def frame_of(
    places: Sequence[Mapping[str, Any]], numbers: Sequence[Mapping[str, Any]], problems: Sequence[str]
) -> "pd.DataFrame":
    """Make a DataFrame of cells.

    Parameters
    ----------
    places, numbers : sequences of mappings
        Of each cell; what one lacks is missing in its row.
    problems : sequence of str
        Why a cell has no numbers; a column only where one has a problem.
    """
    import pandas as pd

    columns = {name: [place.get(name) for place in places] for name in _names(places)}
    columns |= {name: [number.get(name) for number in numbers] for name in _names(numbers)}
    if any(problems):
        columns[PROBLEM] = list(problems)
    return pd.DataFrame(columns)


def _names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """All keys, in the order in which they first appear."""
    distinct = dict.fromkeys(tuple(row) for row in rows)
    return list(dict.fromkeys(name for names in distinct for name in names))


def export(table: "pd.DataFrame", path: Path) -> None:
    """Write a table as ``.csv``, or as ``.parquet`` where pyarrow is installed."""
    partial = path.with_name(f"{path.name}.partial")
    try:
        if path.suffix == ".csv":
            table.to_csv(partial, index=False)
        elif path.suffix == ".parquet":
            table.to_parquet(partial, index=False)
        else:
            raise TilestampError(f"{path}: tables are written as .csv or .parquet")
        partial.replace(path)
    except ImportError:
        raise TilestampError("Parquet needs pyarrow: python -m pip install 'tilestamp[study]'") from None
    except OSError as error:
        raise TilestampError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        partial.unlink(missing_ok=True)
