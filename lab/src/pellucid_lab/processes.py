"""Jobs in several processes or threads: their results come in the order of the jobs, which tell how much is done."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pellucid._processes import Job, finished_results, processes, worker_count

SHARE_INTERVAL_S = 1.0
"""Time after which the shares that jobs tell are read again [s]."""

_share_of_job: ContextVar[Callable[[float], None]] = ContextVar("_share_of_job", default=lambda share: None)
_shares: Any = None  # share done of each job, in a helper process that `shared_results` started


def tell_job_share(share: float) -> None:
    """Tell the share of the job that is done, 0 to 1, or within `job_part` of that part.

    `shared_results` reads it; anywhere else nobody does.
    """
    _share_of_job.get()(share)


@contextmanager
def job_part(part: int, of: int) -> Iterator[None]:
    """Let `tell_job_share` in this context tell the share of part number `part` of `of` equal ones of the job."""
    whole = _share_of_job.get()
    token = _share_of_job.set(lambda share: whole((part + share) / of))
    try:
        yield
        whole((part + 1) / of)
    finally:
        _share_of_job.reset(token)


def ordered_results(
    jobs: Sequence[Job],
    workers: int | None = None,
    tell: Callable[[int, int], None] = lambda done, of: None,
    executor: Executor | None = None,
) -> list:
    """Run `jobs` in `workers` processes or in an `executor`, and return their results in the order of the jobs.

    After each job, `tell` is called with the number of finished jobs and of all jobs.
    """
    found: dict[int, Any] = {}
    for i, result in finished_results(jobs, workers, executor):
        found[i] = result
        tell(len(found), len(jobs))
    return [found[i] for i in range(len(jobs))]


def results_from_threads(jobs: Sequence[Job], threads: int) -> Iterator[Any]:
    """Run `jobs` in `threads` threads, this one included, and yield their results in the order of the jobs.

    This thread works too, because other threads cannot use the memory that it has released.
    """
    if threads <= 1:
        for make, *arguments in jobs:
            yield make(*arguments)
        return
    own: dict[int, Any] = {}
    with ThreadPoolExecutor(threads - 1) as pool:
        futures = [pool.submit(*job) for job in jobs]
        try:
            for i, future in enumerate(futures):
                for j in range(i, len(jobs)):
                    if future.done():
                        break
                    if not futures[j].done() and futures[j].cancel():
                        make, *arguments = jobs[j]
                        own[j] = make(*arguments)
                yield own.pop(i) if i in own else future.result()
        finally:
            for future in futures:
                future.cancel()


def shared_results(
    jobs: Sequence[Job],
    workers: int | None,
    tell: Callable[[int, float], None],
    weights: Sequence[float],
    executor: Executor | None = None,
) -> list:
    """Run `jobs` as `ordered_results` does, and tell every `SHARE_INTERVAL_S` how much of all of them is done.

    `tell` is called with the number of finished jobs and the share of all work. Jobs tell their own shares by
    `tell_job_share`, except to an `executor`; `weights` are their expected times, in any unit.
    """
    workers = worker_count(workers)
    whole = sum(weights)
    if executor is not None:
        return _results_told([executor.submit(*job) for job in jobs], [0.0] * len(jobs), weights, tell)
    if workers <= 1:
        found, before = [], 0.0
        for i, ((make, *arguments), weight) in enumerate(zip(jobs, weights, strict=True)):
            token = _share_of_job.set(partial(_tell_share, tell, i, before / whole, weight / whole))
            try:
                found.append(make(*arguments))
            finally:
                _share_of_job.reset(token)
            before += weight
            tell(i + 1, before / whole)
        return found
    with _shared_numbers(len(jobs)) as (path, shares), processes(workers, _take_shares, path) as pool:
        return _results_told([pool.submit(_run_sharing, i, *job) for i, job in enumerate(jobs)], shares, weights, tell)


def _results_told(
    begun: Sequence[Future], shares: Sequence[float], weights: Sequence[float], tell: Callable[[int, float], None]
) -> list:
    """Return the results of the jobs that were `begun`, and tell how much of them is done, by their `shares` too."""
    left = set(begun)
    while left:
        done, left = wait(left, timeout=SHARE_INTERVAL_S, return_when=FIRST_COMPLETED)
        for each in done:
            each.result()
        parts = (w * (1.0 if job.done() else s) for w, s, job in zip(weights, shares, begun, strict=True))
        tell(len(begun) - len(left), min(sum(parts) / sum(weights), 1.0))
    return [each.result() for each in begun]


def _tell_share(tell: Callable[[int, float], None], done: int, before: float, weight: float, share: float) -> None:
    """Tell the share of all work, of which a job begins after `before` and takes `weight`."""
    tell(done, before + share * weight)


@contextmanager
def _shared_numbers(count: int) -> Iterator[tuple[Path, Any]]:
    """Provide a file of numbers that processes share, with the numbers, shape (count,), first 0."""
    import numpy as np

    # Windows keeps a file as long as it is mapped.
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "numbers"
        yield path, np.memmap(path, np.float64, "w+", shape=(count,))


def _take_shares(path: Path) -> None:
    """Keep, in a helper process, the numbers to which its jobs write their shares."""
    import numpy as np

    global _shares
    _shares = np.memmap(path, np.float64, "r+")


def _run_sharing(index: int, make: Callable, *arguments: Any) -> Any:
    """Run a job whose share is written to the place `index` of the array."""
    token = _share_of_job.set(lambda share: operator.setitem(_shares, index, share))
    try:
        return make(*arguments)
    finally:
        _share_of_job.reset(token)
