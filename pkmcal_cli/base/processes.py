"""Tasks in several processes: copies of this one, or by joblib new ones, or the workers of a dask cluster.

A work is pickled once and opened once by every worker. Tasks go in batches of a second or two, for a cluster's
scheduler takes some 20 ms for each; they become smaller towards the end, so that all workers end together. Batches of
workers that were lost are done again by others.
"""

from __future__ import annotations

import gc
import os
import signal
import time
import warnings
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, TypeVar

from pkmcal_cli import __version__
from pkmcal_cli.base.errors import PkmcalError, UsageError
from pkmcal_cli.base.forked import POSSIBLE, in_copies
from pkmcal_cli.base.tasks import Work, one_thread

Result = TypeVar("Result")
_BATCH = 1.5  # s
_SHARE = 4  # batches that every worker still gets at least, while there are so many tasks
_ATTEMPTS = 4
_WAIT = 10  # s for an answer of a cluster
_GARBAGE = 50_000  # objects between looks for garbage, as in the program itself
_INSTALL = "install it: `pip install pkmcal[cluster]`"


@dataclass(frozen=True, eq=False)
class _Sealed:
    """A pickled work."""

    content: bytes


@dataclass(frozen=True, eq=False)
class _Refused:
    """What a task raised."""

    error: Exception


@lru_cache(maxsize=2)
def _opened(content: bytes) -> Work[Any]:
    """The work, in a worker; the next batches find it here."""
    import cloudpickle

    if not os.environ.get("PKMCAL_DEBUG"):
        warnings.simplefilter("ignore")
    gc.set_threshold(_GARBAGE)
    with suppress(ValueError):  # not in the main thread: a cluster's worker
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that it works for ends it
    work: Work[Any] = cloudpickle.loads(content)
    return work


def _batch(sealed: _Sealed, numbers: Sequence[int]) -> tuple[bytes, float]:
    """Results by number, pickled, up to the first task that raises, and how long a task took, s; in a worker."""
    import cloudpickle

    work, begun = _opened(sealed.content), time.perf_counter()
    results: dict[int, Any] = {}
    with one_thread():
        for number in numbers:
            try:
                results[number] = work(number)
            except Exception as error:
                results[number] = _Refused(error)
                break
    return cloudpickle.dumps(results), (time.perf_counter() - begun) / len(numbers)


class _Batches:
    """Tasks that are left, cut into batches when a worker is free for one."""

    def __init__(self, numbers: Sequence[int], workers: int) -> None:
        self._left, self._workers, self._seconds = list(numbers), workers, 0.0

    def learn(self, seconds: float) -> None:
        """How long a task took."""
        self._seconds = seconds

    def __iter__(self) -> Iterator[list[int]]:
        while self._left:
            long = int(_BATCH / self._seconds) if self._seconds else 1
            size = max(1, min(long, len(self._left) // (_SHARE * self._workers)))
            numbers, self._left = self._left[:size], self._left[size:]
            yield numbers


def in_batches(
    work: Work[Result], numbers: Sequence[int], jobs: int, cluster: str | None
) -> Iterator[Mapping[int, Result]]:
    """Results by number, as they are there. Raises UsageError for a cluster that does not answer, else as `Workers`."""
    import cloudpickle

    left, sealed = dict.fromkeys(numbers), _Sealed(cloudpickle.dumps(work))
    refused: dict[int, Exception] = {}
    with ExitStack() as stack:
        settings = _settings(stack, cluster)
        for attempt in range(_ATTEMPTS):
            try:
                for results in _once(sealed, list(left), jobs, settings):
                    for number, result in results.items():
                        del left[number]
                        if isinstance(result, _Refused):
                            refused[number] = result.error
                    if accepted := {n: r for n, r in results.items() if n not in refused}:
                        yield accepted
                    if refused and not any(n < min(refused) for n in left):
                        raise refused[min(refused)]  # the first one, as if one process did all
                return
            except _lost(cluster) as error:
                if attempt == _ATTEMPTS - 1:
                    raise _given_up(len(left), error) from error


def _once(
    sealed: _Sealed, numbers: Sequence[int], jobs: int, settings: Mapping[str, Any]
) -> Iterator[Mapping[int, Any]]:
    """The same by workers of which none is lost."""
    import cloudpickle

    done: Generator[tuple[bytes, float], None, None]
    if POSSIBLE and "client" not in settings:
        batches = _Batches(numbers, jobs)
        done = in_copies(partial(_batch, sealed), iter(batches), jobs)
    else:
        from joblib import Parallel, delayed, parallel_config

        with parallel_config(n_jobs=jobs, **settings):
            pool = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
            batches = _Batches(numbers, pool._effective_n_jobs())
            done = pool(delayed(_batch)(sealed, part) for part in batches)
    with closing(done):
        for results, seconds in done:
            batches.learn(seconds)
            yield cloudpickle.loads(results)


def _settings(stack: ExitStack, cluster: str | None) -> dict[str, Any]:
    """Of joblib: which workers. Raises UsageError."""
    if cluster is None:
        return {"backend": "loky", "inner_max_num_threads": 1}
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError("--cluster needs dask's `distributed`, which is not installed", hint=_INSTALL) from error
    try:
        client = stack.enter_context(Client(cluster, timeout=_WAIT, set_as_default=False))
        client.wait_for_workers(1, timeout=_WAIT)
        there = client.run(_version)
    except (OSError, ValueError, TimeoutError) as error:
        message = f"--cluster: no scheduler with workers answers at `{cluster}`"
        raise UsageError(
            message, hint="start them: `dask scheduler`, and `dask worker ADDRESS` on every machine"
        ) from error
    except ImportError as error:
        raise UsageError("--cluster: a worker has no pkmcal", hint=f"install pkmcal {__version__} there") from error
    if other := sorted({version for version in there.values() if version != _version()}):
        message = f"--cluster: a worker has {other[0]}, this is {_version()}"
        raise UsageError(
            message, hint="install the same versions on all machines, or results would depend on the worker"
        )
    return {"backend": "dask", "client": client, "wait_for_workers_timeout": _WAIT}


def _version() -> str:
    """What results may depend on, in a worker."""
    import numpy

    return f"pkmcal {__version__} with numpy {numpy.__version__}"


def _lost(cluster: str | None) -> tuple[type[BaseException], ...]:
    """What is raised where a worker has gone."""
    if cluster is None:
        return (BrokenExecutor,)
    from distributed.client import FutureCancelledError
    from distributed.scheduler import KilledWorker

    return (CancelledError, FutureCancelledError, KilledWorker)


def _given_up(left: int, error: BaseException) -> PkmcalError:
    message = f"workers stopped {_ATTEMPTS} times before finishing; {left} tasks are left"
    return PkmcalError(message, None, f"if memory is short, use fewer `--jobs` ({type(error).__name__})", "workers")
