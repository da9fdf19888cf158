"""Jobs over processes: the same whoever does them, errors come through, and nobody's script is run again."""

from __future__ import annotations

import math
import operator
import subprocess
import sys

import pytest

from pellucid import _processes
from pellucid._processes import keep_helpers, results_with_helpers

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
