"""Jobs spread over processes that share the processors, each with one thread: more would wait for each other."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, nullcontext
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Lock
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What libraries of linear algebra and of trees ask how many threads they may have, when they are loaded."""

Job = tuple
"""A function and its arguments."""


def finished(
    jobs: Sequence[Job], workers: int | None = None, executor: Executor | None = None
) -> Iterator[tuple[int, Any]]:
    """Do jobs, and hand over what each gave as soon as it is there; a list of jobs may grow meanwhile. An `executor`,
    a cluster's for instance, takes the place of this machine's processes."""
    workers = workers or os.cpu_count() or 1
    if workers <= 1 and executor is None:
        for i, (make, *arguments) in enumerate(jobs):
            yield i, make(*arguments)
        return
    with processes(workers) if executor is None else nullcontext(executor) as pool:
        waiting, begun = {}, 0
        while waiting or begun < len(jobs):
            waiting |= {pool.submit(*jobs[i]): i for i in range(begun, len(jobs))}
            begun = len(jobs)
            for done in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(done), done.result()


def in_order(
    jobs: Sequence[Job],
    workers: int | None = None,
    tell: Callable[[int, int], None] = lambda done, of: None,
    executor: Executor | None = None,
) -> list:
    """What each of `jobs` gave, in their order, by `workers` processes or an `executor`; `tell` hears how many of how
    many are done."""
    found: dict[int, Any] = {}
    for i, result in finished(jobs, workers, executor):
        found[i] = result
        tell(len(found), len(jobs))
    return [found[i] for i in range(len(jobs))]


def among_helpers(
    jobs: Sequence[Job], workers: int | None = None, begun: Callable[[int, float], None] = lambda i, share: None
) -> list:
    """What each of `jobs` gave, in their order, this process being one of the `workers`: it has loaded already what
    helpers load first. `begun` hears which job begins, and the share of them that is done. The longest are best first.
    """
    from threadpoolctl import threadpool_limits

    # Helpers have no helpers of their own.
    workers = 1 if parent_process() else min(workers or os.cpu_count() or 1, len(jobs))
    left, found, turn = iter(enumerate(jobs)), {}, Lock()

    def work(do: Callable) -> None:
        nonlocal left
        try:
            while True:
                with turn:
                    i, job = next(left, (-1, ()))
                    if not job:
                        return
                    begun(i, len(found) / len(jobs))
                found[i] = do(*job)
        except BaseException:
            # Where one fails no other begins.
            left = iter(())
            raise

    # One thread here too, so that a job gives the same bits wherever it is done.
    with threadpool_limits(1):
        if workers <= 1:
            work(_do)
        else:
            with _helpers(workers - 1) as pool, ThreadPoolExecutor(workers - 1) as threads:
                helped = [threads.submit(work, lambda *job: pool.submit(*job).result()) for _ in range(workers - 1)]
                work(_do)
                for each in helped:
                    each.result()
    return [found[i] for i in range(len(jobs))]


def _do(make: Callable, *arguments: Any) -> Any:
    return make(*arguments)


_kept: list[tuple[ExitStack, list[ProcessPoolExecutor]]] = []


@contextmanager
def helpers_kept() -> Iterator[None]:
    """Calls of `among_helpers` meanwhile have the same helpers, begun with the first that needs some: each loads what
    it works with once."""
    with ExitStack() as stack:
        _kept.append((stack, []))
        stack.callback(_kept.pop)
        yield


@contextmanager
def _helpers(workers: int) -> Iterator[ProcessPoolExecutor]:
    if not _kept:
        with processes(workers) as pool:
            yield pool
        return
    stack, pools = _kept[-1]
    if not pools:
        pools.append(stack.enter_context(processes(max(workers, (os.cpu_count() or 1) - 1))))
    yield pools[0]


class _Helper(SpawnProcess):
    """A process that does not run once more the script that calls Pellucid: no job is of the script's making."""

    def start(self) -> None:
        script = sys.modules["__main__"]
        path = vars(script).pop("__file__", None) if getattr(script, "__spec__", None) is None else None
        try:
            super().start()
        finally:
            if path is not None:
                script.__file__ = path


class _Helpers(SpawnContext):
    Process = _Helper


@contextmanager
def processes(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of `workers`, as many as there are processors if None; forked, they would inherit libraries' locks."""
    with one_thread_each(), ProcessPoolExecutor(workers, mp_context=_Helpers()) as pool:
        yield pool


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes that are begun meanwhile use one thread each."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
