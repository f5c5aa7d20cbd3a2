"""Tasks side by side, through joblib: in this process, in processes of this computer (loky), or on a cluster (dask).

A worker that dies takes no task with it: what it had is given to another one.
"""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, TypeVar

from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")
R = TypeVar("R")
RETRIES = 3  # deaths of workers in a row, between which no task ended
LOCAL = "local"  # a cluster that is started here


def unordered(calls: Iterable[Any], jobs: int) -> Iterator[Any]:
    """Results of joblib's delayed calls as they come, from workers that do not hear Ctrl-C: we end them."""
    from joblib import Parallel

    resource_tracker.ensure_running()  # or joblib starts it in what follows, and it lets signals through
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        results: Iterator[Any] = Parallel(jobs, return_as="generator_unordered", batch_size=1)(calls)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    return results


class Pool:
    """Workers; made by ``pool``."""

    def __init__(self, jobs: int, client: "Client | None") -> None:
        self.jobs = jobs
        self._client = client

    def map(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """Results of a function for some tasks, as they come.

        Raises
        ------
        TilestampError
            Workers die again and again.
        """
        from joblib import delayed, parallel_config
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        left, deaths = dict(enumerate(tasks)), 0
        backend = {"backend": "dask", "client": self._client} if self._client else {"backend": "loky"}
        while left:
            try:
                with parallel_config(**backend):
                    for number, result in unordered(
                        [delayed(_numbered)(function, *item) for item in left.items()], self.jobs
                    ):
                        del left[number]
                        deaths = 0
                        yield result
            except TerminatedWorkerError:
                deaths += 1
                if deaths > RETRIES:
                    raise TilestampError(
                        f"worker processes ended before their time, {deaths} times in a row: out of memory? try -j 1"
                    ) from None


def _numbered(function: Callable[[T], R], number: int, task: T) -> tuple[int, R]:
    return number, function(task)


@contextmanager
def pool(jobs: int, cluster: str | None = None) -> Iterator[Pool]:
    """Give workers.

    Parameters
    ----------
    jobs : int
        Processes here; 1 runs everything in this one. Of a cluster elsewhere, its own number counts.
    cluster : str, optional
        ``local`` starts one of ``jobs`` processes here; else the address of a scheduler, ``tcp://HOST:8786``.

    Raises
    ------
    TilestampError
        dask.distributed is not installed, or there is no scheduler at the address.
    """
    if cluster is not None:
        with _client(jobs, cluster) as client:
            yield Pool(max(sum(client.ncores().values()), 1), client)
        return
    try:
        yield Pool(jobs, None)
    except BaseException:
        if jobs > 1:
            end_processes()
        raise


def end_processes() -> None:
    """End all worker processes of this computer."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True).shutdown(kill_workers=True)


@contextmanager
def _client(jobs: int, cluster: str) -> "Iterator[Client]":
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise TilestampError("--cluster needs dask.distributed: python -m pip install 'tilestamp[cluster]'") from None
    if cluster == LOCAL:
        with (
            _main_left_alone(),
            LocalCluster(
                n_workers=jobs, threads_per_worker=1, dashboard_address=None, worker_dashboard_address=None
            ) as started,
            Client(started) as client,
        ):
            yield client
        return
    try:
        client = Client(cluster, timeout=10)
    except (OSError, ValueError, TypeError) as error:
        raise TilestampError(f"--cluster {cluster}: no scheduler answers there ({error})") from error
    with client:
        yield client


@contextmanager
def _main_left_alone() -> Iterator[None]:
    """Keep multiprocessing from running the main script again in each new process: workers need nothing of it."""
    main = sys.modules["__main__"]
    kept: dict[str, Any] = {name: main.__dict__.pop(name) for name in ("__file__", "__spec__") if name in main.__dict__}
    main.__dict__["__spec__"] = None
    try:
        yield
    finally:
        main.__dict__.update(kept)
