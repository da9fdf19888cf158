"""Jobs over processes: the same whoever does them, errors come through, and nobody's script is run again."""

from __future__ import annotations

import math
import operator
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import parent_process
from operator import methodcaller
from threading import current_thread
from types import SimpleNamespace

import pytest
from research.benchmarks import _runner
from threadpoolctl import threadpool_info, threadpool_limits

import pellucid as pl
from pellucid import _processes
from pellucid._errors import DatasetError
from pellucid._processes import THREAD_VARIABLES, keep_helpers, results_with_helpers, with_one_blas_thread
from pellucid_lab import processes
from pellucid_lab.processes import (
    job_part,
    ordered_results,
    results_from_threads,
    shared_results,
    tell_job_share,
)

SCRIPT = """
import math
from pellucid._processes import results_with_helpers
print(results_with_helpers([(math.factorial, i) for i in range(6)], 2), __file__)
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_what_was_found_is_in_the_order_of_the_jobs(workers):
    begun = []
    made = results_with_helpers(
        [(math.factorial, i) for i in range(6)], workers, lambda i, share: begun.append((i, share))
    )
    assert made == [1, 1, 2, 6, 24, 120]
    assert sorted(i for i, _ in begun) == list(range(6))
    assert [share for _, share in begun] == sorted(share for _, share in begun)
    with pytest.raises(ZeroDivisionError):
        results_with_helpers([(operator.truediv, 1, i) for i in (1, 0, 1)], workers)


def work_in_parts(parts, pause):
    """Tell the share of two parts, each of several steps, and return their number."""
    for part in range(2):
        with job_part(part, 2):
            for step in range(parts):
                time.sleep(pause)
                tell_job_share((step + 1) / parts)
    return parts


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_tell_their_shares_while_they_last(workers, monkeypatch):
    monkeypatch.setattr(processes, "SHARE_INTERVAL_S", 0.05)
    told = []
    made = shared_results(
        [(work_in_parts, 4, 0.1), (work_in_parts, 1, 0.1)], workers, lambda done, share: told.append((done, share)),
        [3.0, 1.0],
    )  # fmt: skip
    assert made == [4, 1]
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[-1] == (2, pytest.approx(1.0))
    # The first job has three quarters of the weight, and tells eight steps before it ends.
    assert len({share for share in shares if 0.0 < share < 1.0}) >= 5
    with pytest.raises(ZeroDivisionError):
        shared_results([(operator.truediv, 1, i) for i in (1, 0, 1)], workers, lambda done, share: None, [1.0] * 3)
    # Outside such jobs nobody listens.
    assert work_in_parts(1, 0.0) == 1


def test_jobs_run_on_the_executor_that_is_given():
    threads, told = [], []
    with ThreadPoolExecutor(1, thread_name_prefix="given") as executor:
        jobs = [(lambda i: threads.append(current_thread().name) or i, i) for i in range(3)]
        made = shared_results(jobs, None, lambda done, share: told.append((done, share)), [1.0, 2.0, 1.0], executor)
    assert made == [0, 1, 2]
    assert threads == ["given_0"] * 3
    assert told[-1] == (3, pytest.approx(1.0))


def nested_processes():
    """Return which processes run jobs of a job."""
    return {os.getpid(), *ordered_results([(os.getpid,)] * 4, 2)}


def test_a_helper_starts_no_helpers():
    assert all(len(found) == 1 for found in ordered_results([(nested_processes,)] * 2, 2))


@pytest.mark.parametrize("executor", [None, "given"])
def test_proofs_run_here_or_on_an_executor(executor, monkeypatch, capsys):
    modules = {
        "research.evidence.whole": lambda: iter([1, 2]),
        "research.evidence.broken": lambda: (1 // (2 - i) for i in range(4)),
        "research.evidence.absent": lambda: (_ for _ in ()).throw(DatasetError("no folder: found none")),
    }
    monkeypatch.setattr(_runner, "import_module", lambda name: SimpleNamespace(rows=modules[name]))
    names = [name.split(".")[-1] for name in modules]
    with ThreadPoolExecutor(2) as given:
        rows, failed = _runner.run_all("evidence", names, methodcaller("rows"), executor and given)
    assert rows == [1, 2, 0, 1]
    assert failed == ["broken"]
    said = capsys.readouterr().out
    assert "broken: Traceback" in said
    assert "ZeroDivisionError" in said
    assert "absent: not measured: no folder: found none" in said


def test_kept_helpers_are_begun_once(monkeypatch):
    begun, begin = [], _processes.processes
    monkeypatch.setattr(_processes, "processes", lambda workers: begun.append(workers) or begin(workers))
    jobs = [(math.factorial, i) for i in range(6)]
    with keep_helpers():
        assert results_with_helpers(jobs, 1) == [1, 1, 2, 6, 24, 120]
        assert not begun
        with pytest.raises(ZeroDivisionError):
            results_with_helpers([(operator.truediv, 1, i) for i in (1, 0, 1)], 2)
        assert results_with_helpers(jobs, 2) == [1, 1, 2, 6, 24, 120]
        assert len(begun) == 1
    assert results_with_helpers(jobs, 2) == [1, 1, 2, 6, 24, 120]
    assert len(begun) == 2


def test_a_script_is_not_run_again_by_its_helpers(tmp_path):
    path = tmp_path / "script.py"
    path.write_text(SCRIPT, encoding="utf-8")
    said = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=True).stdout
    assert said.splitlines() == [f"[1, 1, 2, 6, 24, 120] {path}"]


def thread_numbers():
    """Return whether this is a helper process, and how many threads its libraries get."""
    return parent_process() is not None, [os.environ.get(name) for name in THREAD_VARIABLES]


def test_each_process_has_one_thread_and_this_one_its_own_number(monkeypatch):
    monkeypatch.setenv(THREAD_VARIABLES[0], "2")
    assert ordered_results([(thread_numbers,)] * 3, 2) == [(True, ["1"] * len(THREAD_VARIABLES))] * 3
    assert os.environ[THREAD_VARIABLES[0]] == "2"


@pytest.mark.parametrize("run", [ordered_results, lambda jobs, n: shared_results(jobs, n, lambda *_: None, [1.0] * 3)])
def test_a_process_that_dies_is_an_error(run):
    with pytest.raises(BrokenProcessPool):
        run([(os._exit, 3), (math.factorial, 3), (math.factorial, 4)], 2)


def test_linear_algebra_has_one_thread_within_and_its_own_number_after():
    def threads():
        return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]

    with threadpool_limits(2, "blas"):
        assert set(with_one_blas_thread(threads)()) == {1}
        assert set(threads()) == {2}
        with pytest.raises(ZeroDivisionError):
            with_one_blas_thread(lambda: 1 // 0)()
        assert set(threads()) == {2}
    assert with_one_blas_thread(pl.fit_joint).__doc__ == pl.fit_joint.__doc__


def slow_square(number, threads):
    threads.add(threading.get_ident())
    time.sleep(0.01)
    return number**2


@pytest.mark.parametrize("count", [1, 2, 3])
def test_results_of_threads_come_in_order_and_this_thread_works_too(count):
    used = set()
    jobs = [(slow_square, number, used) for number in range(12)]
    assert list(results_from_threads(jobs, count)) == [number**2 for number in range(12)]
    assert threading.get_ident() in used
    assert len(used) == count


@pytest.mark.parametrize("failing", [0, 1, 5])
def test_a_job_that_fails_in_a_thread_stops_the_others(failing):
    begun = []

    def job(number):
        begun.append(number)
        time.sleep(0.02)
        return 1 // (number - failing)

    with pytest.raises(ZeroDivisionError):
        list(results_from_threads([(job, number) for number in range(100)], 2))
    assert len(begun) < 50
