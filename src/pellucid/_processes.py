"""Run jobs in several processes with one thread each, since more threads than processors would wait for each other.

The processes are those of loky, which neither inherit the locks of libraries, as forked ones would, nor run the script
again that calls Pellucid, as spawned ones do.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from functools import wraps
from threading import Lock
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

    from loky import ProcessPoolExecutor

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables from which libraries of linear algebra and of trees read their number of threads when they are
loaded."""

Job = tuple
"""A function, followed by its arguments."""

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


MAX_PROCESS_GROWTH_BYTES = 1e12
"""Growth of memory above which loky replaces a process. It is out of reach, because caches for later jobs are no leak.
"""


def with_one_blas_thread(function: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """Return a `function` that lets linear algebra use one thread, as the command line does.

    Matrices are small here: more threads wait for each other for longer than they multiply, and sum in another order.
    """

    @wraps(function)
    def on_one_thread(*arguments: Parameters.args, **options: Parameters.kwargs) -> Returned:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, "blas"):
            return function(*arguments, **options)

    return on_one_thread


class InlineExecutor:
    """Executor that runs each task at once, in the calling process; for tasks that already run on a worker."""

    def submit(self, function: Callable, *arguments: Any) -> Future:
        """Run the function and return a future that is done."""
        from concurrent.futures import Future

        outcome: Future = Future()
        outcome.set_result(function(*arguments))
        return outcome


def worker_count(workers: int | None = None) -> int:
    """Return the number of processes for `workers` asked for, or for every processor; 1 in a helper process.

    A helper process starts no helpers of its own: its siblings already use the other processors, and a cluster's worker
    may not have children.
    """
    from multiprocessing import parent_process

    return 1 if parent_process() else workers or os.cpu_count() or 1


def finished_results(
    jobs: Sequence[Job], workers: int | None = None, executor: Executor | None = None
) -> Iterator[tuple[int, Any]]:
    """Run jobs, and yield the index and the result of each as soon as it is done; the list of jobs may grow meanwhile.

    An `executor`, such as a cluster's, replaces the processes of this machine.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    workers = worker_count(workers)
    if workers <= 1 and executor is None:
        for i, (make, *arguments) in enumerate(jobs):
            yield i, make(*arguments)
        return
    with processes(workers) if executor is None else nullcontext(executor) as pool:
        waiting: dict[Future, int] = {}
        begun = 0
        while waiting or begun < len(jobs):
            waiting |= {pool.submit(*jobs[i]): i for i in range(begun, len(jobs))}
            begun = len(jobs)
            for done in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(done), done.result()


def results_with_helpers(
    jobs: Sequence[Job], workers: int | None = None, begun: Callable[[int, float], None] = lambda i, share: None
) -> list:
    """Run `jobs` in `workers` processes, this one included, and return their results in the order of the jobs.

    This process works too, because it has already loaded what the others must load first. Before each job, `begun` is
    called with its index and the share of finished jobs. Long jobs should come first.
    """
    from concurrent.futures import ThreadPoolExecutor

    from threadpoolctl import threadpool_limits

    workers = min(worker_count(workers), len(jobs))
    left: Iterator[tuple[int, Job]] = iter(enumerate(jobs))
    found: dict[int, Any] = {}
    turn = Lock()

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
            # After a failure no other job begins.
            left = iter(())
            raise

    # This process also uses one thread, so that a job gives the same bits in every process.
    with threadpool_limits(1):
        if workers <= 1:
            work(_call)
        else:
            with _helper_pool(workers - 1) as pool, ThreadPoolExecutor(workers - 1) as threads:
                helped = [threads.submit(work, lambda *job: pool.submit(*job).result()) for _ in range(workers - 1)]
                work(_call)
                for each in helped:
                    each.result()
    return [found[i] for i in range(len(jobs))]


def _call(make: Callable, *arguments: Any) -> Any:
    return make(*arguments)


_kept_pools: list[tuple[ExitStack, list[ProcessPoolExecutor]]] = []


@contextmanager
def keep_helpers() -> Iterator[None]:
    """Keep the helper processes for all calls of `results_with_helpers` in this context, so that each loads its
    libraries only once."""
    with ExitStack() as stack:
        _kept_pools.append((stack, []))
        stack.callback(_kept_pools.pop)
        yield


@contextmanager
def _helper_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    if not _kept_pools:
        with processes(workers) as pool:
            yield pool
        return
    stack, pools = _kept_pools[-1]
    if not pools:
        pools.append(stack.enter_context(processes(max(workers, (os.cpu_count() or 1) - 1))))
    yield pools[0]


def processes(
    workers: int | None = None, initializer: Callable[..., None] | None = None, *arguments: Any
) -> ProcessPoolExecutor:
    """Return a pool of `workers` processes, by default one for each processor; a context that ends them.

    Each process calls the `initializer`, if any, with its `arguments` before its first job.
    """
    from loky import ProcessPoolExecutor

    environment = dict.fromkeys(THREAD_VARIABLES, "1") | {"LOKY_MAX_MEMORY_LEAK_SIZE": str(MAX_PROCESS_GROWTH_BYTES)}
    return ProcessPoolExecutor(workers or os.cpu_count(), env=environment, initializer=initializer, initargs=arguments)
