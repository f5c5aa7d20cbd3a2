"""What a misspelt name was probably meant to be."""

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Clause for an error message that names the nearest known name; empty where none is near.

    Parameters
    ----------
    word : str
        As the user wrote it.
    known : iterable of str

    Returns
    -------
    str
        As in `` (did you mean 'gtx280'?)``, with the blank before it.
    """

    def distance(other: str) -> tuple[float, bool]:  # of two as near, the one that begins alike: gtx280 for gtx290
        return -difflib.SequenceMatcher(None, other, word).ratio(), other[:4] != word[:4]

    near = sorted(difflib.get_close_matches(word, list(known)), key=distance)
    return f" (did you mean {near[0]!r}?)" if near else ""
