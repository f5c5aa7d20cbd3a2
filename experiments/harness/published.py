"""Published tables, as CSV beside the experiments that use them."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def published(experiment: str, table: str) -> "pd.DataFrame":
    """Read ``TABLE.csv`` beside the module whose ``__file__`` is ``experiment``."""
    import pandas as pd

    return pd.read_csv(Path(experiment).parent / f"{table}.csv")
