"""Workers on a cluster of dask.distributed: one that is started here, or one that has a scheduler somewhere."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "local"  # a cluster that is started here
PATIENCE = 10.0  # seconds in which a scheduler has to answer


@contextmanager
def cluster_client(jobs: int, cluster: str) -> "Iterator[Client]":
    """Give a client of a cluster.

    Parameters
    ----------
    jobs : int
        Processes of a cluster that is started here.
    cluster : str
        ``local``, or the address of a scheduler.

    Raises
    ------
    TilestampError
        dask.distributed is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise TilestampError("a cluster needs dask.distributed: python -m pip install 'tilestamp[cluster]'") from None
    if cluster == LOCAL:
        with (
            _main_left_alone(),
            LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=":0") as started,
            Client(started) as client,
        ):
            yield client
        return
    try:
        client = Client(cluster, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise TilestampError(f"no scheduler of a cluster answers at {cluster} ({error})") from error
    with client:
        yield client


@contextmanager
def _main_left_alone() -> Iterator[None]:
    """Keep multiprocessing from running the main script again in each new process: workers need nothing of it."""
    main = sys.modules["__main__"]
    kept: dict[str, Any] = {name: main.__dict__.pop(name) for name in ("__file__", "__spec__") if hasattr(main, name)}
    main.__dict__["__spec__"] = None
    try:
        yield
    finally:
        main.__dict__.update(kept)


def cluster_backend(client: "Client") -> Any:
    """Joblib's backend of dask, mended: it says that a task failed for good, for which joblib would wait."""
    from joblib._dask import DaskDistributedBackend

    class Backend(DaskDistributedBackend):  # type: ignore[misc]  # joblib has no types
        def effective_n_jobs(self, n_jobs: int) -> int:
            return max(2, int(super().effective_n_jobs(n_jobs)))  # of one worker joblib would make none, and work here

        def submit(self, func: Any, callback: Any = None) -> Any:
            future = super().submit(func, callback)
            future.add_done_callback(lambda done: callback(done.exception()) if done.exception() else None)
            return future

        def retrieve_result_callback(self, out: Any) -> Any:
            if isinstance(out, BaseException):
                raise out
            return super().retrieve_result_callback(out)

    return Backend(client=client)
