"""Benchmarks compare at the same number of threads."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from research.benchmarks._runner import check_one_thread
from threadpoolctl import threadpool_info, threadpool_limits

ROOT = Path(__file__).parents[2]

THREADS_OF_RIVALS = """
import runpy, sys
from types import SimpleNamespace
import research.benchmarks._runner as runner
def run():
    import os, subprocess, numpy, scipy.linalg
    from threadpoolctl import threadpool_info
    here = max(one["num_threads"] for one in threadpool_info())
    code = "import numpy; from threadpoolctl import threadpool_info as t; print(max(one['num_threads'] for one in t()))"
    started = int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout)
    print("THREADS", here, started)
    return []
runner.import_module = lambda name: SimpleNamespace(run=run, __name__=name)
sys.argv = ["benchmarks", "hill", "--out", sys.argv[1]]
runpy.run_module("research.benchmarks", run_name="__main__")
"""
"""A benchmark that prints the threads that linear algebra would use in its process and in one that it starts."""


def test_rivals_use_one_thread_each_where_the_environment_says_nothing(tmp_path):
    plain = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", THREADS_OF_RIVALS, str(tmp_path / "figures.json")], cwd=ROOT,
                          env=plain, capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "THREADS 1 1" in done.stdout


def test_a_library_with_several_threads_spoils_a_benchmark():
    import numpy as np

    assert np.linalg.svd(np.eye(2), compute_uv=False).sum() == 2.0
    if not any(one["internal_api"] == "openblas" for one in threadpool_info()):
        pytest.skip("this NumPy has no OpenBLAS, whose threads can be set")
    with threadpool_limits(2), pytest.raises(RuntimeError, match="several threads, expected one each"):
        check_one_thread("any")
    with threadpool_limits(1):
        check_one_thread("any")
