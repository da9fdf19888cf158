"""Tests in real time, marked `real_time`: run again where this machine paused the engine, and a law stopped for that.

A law stops, as it should, when its engine does not run for longer than the law's `max_age`. A shared machine may pause
any process for longer. A test that fails after such a stop says nothing of what it tests, and is run again; a test that
fails for any other reason is not.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from _pytest.runner import call_and_report

from pellucid.controllers.supervisor_faults import FAULT_NAMES
from pellucid.live.engine import LiveEngine

MAX_RUNS = 3
"""A test is run at most so often."""

PAUSE_PROPERTY = "failed after a pause of the machine"
"""Name under which the reports of a test list the pause of each run that failed after one."""

_held: list[tuple[float, float]] = []  # when a test itself held an engine, on the monotonic clock [s]


@contextmanager
def held(process: int) -> Iterator[None]:
    """Stop a process until the block ends; a gap in this time is no pause of the machine."""
    begun = time.monotonic()
    os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        _held.append((begun, time.monotonic()))
        os.kill(process, signal.SIGCONT)


def longest_pause(engine: LiveEngine) -> float:
    """Return the longest pause that stopped a law of an engine [s], 0 for none."""
    _, records, _ = engine.region.records_since(0)
    ages = [np.inf if each.law is None else each.law.values["max_age"] for each in engine.setup.conditions]
    ended = 1e-9 * records["time"][1:]
    begun = 1e-9 * records["time"][:-1]
    fault = records["fault"].astype(int)
    stopped = (np.diff(fault) != 0) & (fault[1:] == FAULT_NAMES.index("stale"))
    # A law is stopped in the first cycle after the pause, or in the next: the pause may lie within a cycle.
    stopped[:-1] |= stopped[1:].copy()
    pause = np.where(stopped, ended - begun, 0.0)
    for first, last in _held:
        pause[(begun < last) & (ended > first)] = 0.0
    too_old = pause > np.array(ages)[records["law"][1:]] - engine.setup.period
    return float(np.max(pause, where=too_old, initial=0.0))


@contextmanager
def watched_engines() -> Iterator[Callable[[], float]]:
    """Yield a function that returns the longest pause that stopped a law of an engine of this block [s]."""
    running: list[LiveEngine] = []
    ended = [0.0]
    begin, close = LiveEngine.__init__, LiveEngine.close

    def begin_watched(engine, *arguments, **options):
        begin(engine, *arguments, **options)
        running.append(engine)

    def close_watched(engine):
        if engine in running:
            running.remove(engine)
            ended.append(longest_pause(engine))
        close(engine)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LiveEngine, "__init__", begin_watched)
        patch.setattr(LiveEngine, "close", close_watched)
        yield lambda: max([*ended, *map(longest_pause, running)])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    if item.get_closest_marker("real_time") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for run in range(1, MAX_RUNS + 1):
        item._initrequest()
        with watched_engines() as pause_now:
            reports = [call_and_report(item, "setup", log=False)]
            if reports[0].passed:
                reports.append(call_and_report(item, "call", log=False))
            pause = pause_now() if reports[-1].when == "call" and reports[-1].failed else 0.0
            again = pause > 0.0 and run < MAX_RUNS
            if pause:
                for properties in (item.user_properties, reports[-1].user_properties):
                    properties.append((PAUSE_PROPERTY, f"{1e3 * pause:.0f} ms"))
            # Fixtures of the module and of the session are kept for the next run.
            until = item.parent if again else None if item.session.shouldfail or item.session.shouldstop else nextitem
            reports.append(call_and_report(item, "teardown", log=False, nextitem=until))
        if not again:
            break
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter) -> None:
    for report in (*terminalreporter.stats.get("passed", ()), *terminalreporter.stats.get("failed", ())):
        pauses = [value for name, value in report.user_properties if name == PAUSE_PROPERTY]
        if pauses and report.when == "call":
            ended = "passed in another run" if report.passed else f"failed in {len(pauses)} runs"
            terminalreporter.write_line(f"{report.nodeid} {ended}: the machine paused its engine ({', '.join(pauses)})")
