"""Threads over parts: each part once, errors and Ctrl-C come through."""

import numpy as np
import pytest

from tilestamp.simulator.parallel import for_parts, parts_of

pytestmark = pytest.mark.small


def test_each_part_is_worked_on_once():
    seen = np.zeros(50, np.int64)

    def worker(part, parts, out):
        assert parts == len(out)
        out[part] += 1

    for_parts(worker, 50, seen)
    assert (seen == 1).all()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_a_part_raises_comes_through_and_later_parts_do_not_begin(error):
    begun = []

    def worker(part, parts):
        begun.append(part)
        raise error

    with pytest.raises(error):
        for_parts(worker, 1000)
    assert len(begun) < 1000


def test_there_is_always_a_part():
    assert parts_of(0) == 1
    assert parts_of(5, smallest=10) == 1
