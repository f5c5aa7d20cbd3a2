"""Quickselect does what ``np.partition`` does."""

import numpy as np
import pytest

from tilestamp.models.partition import partitioned


@pytest.mark.parametrize("kinds", [3, 1000])
def test_the_place_splits_smaller_from_larger(kinds: int) -> None:
    """Every length and place, few kinds of values and many: the right value there, the same values around it."""
    rng = np.random.default_rng(kinds)
    for count in range(1, 24):
        values = rng.integers(0, kinds, count).astype(np.float64)
        for place in range(count):
            found, before = partitioned(values, place), values.copy()
            np.testing.assert_array_equal(np.sort(found), np.sort(values))
            np.testing.assert_array_equal(values, before)
            assert found[place] == np.sort(values)[place]
            assert (found[:place] <= found[place]).all()
            assert (found[place:] >= found[place]).all()
