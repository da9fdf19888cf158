"""Jobs spread over processes that share the processors, each with one thread: more would wait for each other."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What libraries of linear algebra and of trees ask how many threads they may have, when they are loaded."""

Job = tuple
"""A function and its arguments."""


def finished(jobs: Sequence[Job], workers: int | None = None) -> Iterator[tuple[int, Any]]:
    """Do jobs, and hand over what each gave as soon as it is there; a list of jobs may grow meanwhile."""
    workers = workers or os.cpu_count() or 1
    if workers <= 1:
        for i, (make, *arguments) in enumerate(jobs):
            yield i, make(*arguments)
        return
    with processes(workers) as pool:
        waiting, begun = {}, 0
        while waiting or begun < len(jobs):
            waiting |= {pool.submit(*jobs[i]): i for i in range(begun, len(jobs))}
            begun = len(jobs)
            for done in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(done), done.result()


def in_order(
    jobs: Sequence[Job], workers: int | None = None, tell: Callable[[int, int], None] = lambda done, of: None
) -> list:
    """What each of `jobs` gave, in their order, by `workers` processes; `tell` hears how many of how many are done."""
    found: dict[int, Any] = {}
    for i, result in finished(jobs, workers):
        found[i] = result
        tell(len(found), len(jobs))
    return [found[i] for i in range(len(jobs))]


@contextmanager
def processes(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of `workers`, as many as there are processors if None; forked, they would inherit libraries' locks."""
    with one_thread_each(), ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
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
