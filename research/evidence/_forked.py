"""Many short trials in forked processes, each of which may die, run on or swell without the others."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MAX_TRIAL_S = 10.0
"""Longest time of a trial within its limit [s]."""

MAX_TRIAL_BYTES = 1e9
"""Largest memory of a trial within its limit [B]."""

KILL_AFTER_S = 120.0
"""Time after which a trial that has not returned is killed [s]. It is long because processors are shared."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one trial."""

    case: str
    said: str  # What it returned; of one that died, how
    seconds: float  # Of processors; of one that was killed for not coming back, until then
    bytes: float  # Largest memory of its process and of the one that reads for it, up to then
    died: bool = False

    @property
    def over(self) -> bool:
        """Whether it took longer or more than it may."""
        return self.seconds > MAX_TRIAL_S or self.bytes > MAX_TRIAL_BYTES


def tried(cases: Sequence[Any], run: Callable[[Any], str], workers: int = 2) -> list[Outcome]:
    """Outcome of `run` of every case, in their order."""
    shares = [list(range(i, len(cases), workers)) for i in range(workers)]
    found: dict[int, Outcome] = {}
    running = [_start(cases, run, share) for share in shares if share]
    while running:
        ready = select.select([worker.pipe for worker in running], [], [], 0.5)[0]
        for worker in list(running):
            line = worker.pipe.readline() if worker.pipe in ready else b""
            if line:
                i, said, seconds, held = json.loads(line)
                found[i] = Outcome(_shown(cases[i]), said, seconds, held)
                worker.share.remove(i)
                worker.since = time.monotonic()
            elif worker.pipe in ready or time.monotonic() - worker.since > KILL_AFTER_S:
                running.remove(worker)
                os.kill(worker.pid, signal.SIGKILL)
                worker.pipe.close()
                status = os.waitstatus_to_exitcode(os.waitpid(worker.pid, 0)[1])
                if not worker.share:
                    continue
                took = time.monotonic() - worker.since
                first = worker.share[0]
                said, late = f"died with status {status}", took > KILL_AFTER_S
                found[first] = Outcome(_shown(cases[first]), said, took if late else 0.0, 0.0, died=not late)
                if worker.share[1:]:
                    running.append(_start(cases, run, worker.share[1:]))
    return [found[i] for i in range(len(cases))]


@dataclass
class _Worker:
    pid: int
    pipe: Any
    share: list[int]  # Of cases, those that are still to be tried
    since: float


def _start(cases, run, share):
    read, write = os.pipe()
    pid = os.fork()
    if pid:
        os.close(write)
        return _Worker(pid, os.fdopen(read, "rb", buffering=0), share, time.monotonic())
    try:
        os.close(read)
        with os.fdopen(write, "wb", buffering=0) as out:
            for i in share:
                _forget()
                begun = _ran()
                said = run(cases[i])
                out.write(json.dumps([i, said, _ran() - begun, _held()]).encode() + b"\n")
    finally:
        for process in _readers():
            process.kill()
        os._exit(0)


def _readers():
    from pellucid.files.readers import _apart

    return [process for pid, process in _apart._running.items() if pid == os.getpid()]


def _shown(case: Any) -> str:
    parts = case if isinstance(case, tuple) else (case,)
    return " ".join(part.name if isinstance(part, Path) else str(part) for part in parts)


def _ran() -> float:
    """Processor time of this process, its children, and the one that reads for it [s]."""
    total = sum(os.times()[:4])
    for process in _readers():
        with contextlib.suppress(OSError, IndexError):
            fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
            total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


def _forget() -> None:
    """Let peaks of memory begin anew."""
    for pid in (os.getpid(), *(process.pid for process in _readers())):
        try:
            with open(f"/proc/{pid}/clear_refs", "w", encoding="ascii") as peaks:
                peaks.write("5")
        except OSError:
            continue


def _held() -> float:
    """Peak memory of this process and of the one that reads for it [B]."""
    peaks = [0]
    for pid in (os.getpid(), *(process.pid for process in _readers())):
        try:
            with open(f"/proc/{pid}/status", encoding="ascii") as status:
                peaks += [1024 * int(line.split()[1]) for line in status if line.startswith("VmHWM")]
        except OSError:
            continue
    return float(max(peaks))
