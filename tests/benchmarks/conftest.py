"""Sizes of the benchmarks: as named where they are timed, a hundredth where their code only runs (CI)."""

from collections.abc import Callable

import pytest


@pytest.fixture(scope="session")
def timed(request: pytest.FixtureRequest) -> bool:
    """Say whether the clock runs: not with ``--benchmark-disable``."""
    return not request.config.getoption("benchmark_disable")


@pytest.fixture(scope="session")
def scaled(timed: bool) -> Callable[[int], int]:
    """Give the function that makes a size."""
    return (lambda size: size) if timed else (lambda size: max(size // 100, 1))
