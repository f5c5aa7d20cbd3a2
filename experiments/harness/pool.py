"""Tasks side by side, through joblib: in this process, in processes of this computer (loky), or on a cluster (dask).

A worker that dies takes no task with it: what it had is given to another one.
"""

import signal
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, TypeVar

from tilestamp.experiments.harness.cluster import cluster_backend, cluster_client
from tilestamp.experiments.harness.telling import listening, tell_compiling
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar("T")
R = TypeVar("R")
RETRIES = 3  # deaths of workers in a row, between which no task ended
LEFT = "[0-9]+ tasks which were still being processed"  # joblib's warning where a run ends early: we say why
IDLE = 20.0  # seconds after which a process without work ends: those of a parent that was killed, too


def unordered(calls: Iterable[Any], jobs: int) -> Iterator[Any]:
    """Results of joblib's delayed calls as they come, from workers that do not hear Ctrl-C: we end them."""
    from joblib import Parallel

    warnings.filterwarnings("ignore", LEFT, UserWarning)
    resource_tracker.ensure_running()  # or joblib starts it in what follows, and it lets signals through
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        results: Iterator[Any] = Parallel(jobs, return_as="generator_unordered", batch_size=1)(calls)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    return results


class Pool:
    """Workers; made by ``pool``."""

    def __init__(self, jobs: int, client: "Client | None", address: str = "") -> None:
        self.jobs = jobs
        self._client = client
        self._address = address

    def map(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """Results of a function for some tasks, as they come.

        Raises
        ------
        TilestampError
            A task ends each process that takes it.
        """
        from joblib import delayed, parallel_config

        settings, died, deaths = self._backend()
        left = dict(enumerate(tasks))
        while left:
            calls = [delayed(_numbered)(function, *item, self._address) for item in left.items()]
            try:
                with parallel_config(**settings):
                    for number, result in unordered(calls, self.jobs):
                        del left[number]
                        deaths = RETRIES
                        yield result
            except died:
                if not deaths:
                    raise TilestampError(
                        "a task ended each worker process that took it: out of memory? try -j 1, or smaller frames"
                    ) from None
                deaths -= 1

    def _backend(self) -> tuple[dict[str, Any], type[Exception], int]:
        """Settings of joblib, what it raises where a worker died, and how many deaths in a row are borne."""
        if self._client is not None:
            from distributed import KilledWorker

            return {"backend": cluster_backend(self._client)}, KilledWorker, 0  # it has tried again by itself
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        return {"backend": "loky", "idle_worker_timeout": IDLE}, TerminatedWorkerError, RETRIES


def _numbered(function: Callable[[T], R], number: int, task: T, address: str) -> tuple[int, R]:
    if address:
        tell_compiling(address, "running")
    return number, function(task)


@contextmanager
def pool(jobs: int, cluster: str | None = None, say: Callable[[str], None] | None = None) -> Iterator[Pool]:
    """Give workers.

    Parameters
    ----------
    jobs : int
        Processes here; 1 runs everything in this one. Of a cluster elsewhere, its own number counts.
    cluster : str, optional
        ``local`` starts one of ``jobs`` processes here; else the address of a scheduler, ``tcp://HOST:8786``.
    say : callable, optional
        Told what processes of this computer are compiling.

    Raises
    ------
    TilestampError
        dask.distributed is not installed, or there is no scheduler at the address.
    """
    if cluster is not None:
        with cluster_client(jobs, cluster) as client:
            yield Pool(max(sum(client.ncores().values()), 1), client)
        return
    try:
        if say is None or jobs == 1:
            yield Pool(jobs, None)
        else:
            with listening(say) as address:
                yield Pool(jobs, None, address)
    except BaseException:
        if jobs > 1:
            end_processes()
        raise


def end_processes() -> None:
    """End all worker processes of this computer."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True).shutdown(kill_workers=True)
