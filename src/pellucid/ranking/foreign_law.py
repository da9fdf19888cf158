"""Anybody's control law in the ranking: a C file, a shared library or a Python class, in a process of its own.

The law gets what every law of the knee orthosis gets (time, the joint's position, the spring's torque) and answers the
torque that the spring is to have. What it answers passes the core's safety gate: finite, within the limits of effort
and rate, of a joint that is not too fast. A law that does not answer in time, ends, takes too much memory or answers no
number is stopped: the gate shuts, the torque ramps to 0, and the ranking lists why.
"""

from __future__ import annotations

import math
import os
import select
import shutil
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .._errors import PellucidError
from ..control.control_law import safety_gate
from ..control.limits import Limits
from ..control.supervisor_faults import NO_FAULT
from ..studies.study import checksum
from . import foreign_worker

LAW_SUFFIXES = (".c", ".so", ".py")
"""Endings of the files that hold a foreign law."""

MAX_MEMORY_BYTES = 2 * 1024**3
"""Address space of a foreign law's process. An interpreter with NumPy needs half a gigabyte of it."""

MAX_LOAD_S = 30.0
"""Longest time in which a law must be loaded, and in which a C file must be compiled."""

MAX_STEP_S = 2.0
"""Longest time for one answer. It is far longer than a control period, because the machine may be busy."""

VELOCITY_SPAN = 10
"""Number of periods over which the gate's velocity is differenced."""

RATE_LIMIT = 2000.0
"""Limit of the rate of the torque [N m/s]."""

VELOCITY_LIMIT = 25.0
"""A joint faster than this shuts the gate [rad/s]."""

COMPILER_FLAGS = ("-O2", "-fPIC", "-shared", "-std=c11", "-ffp-contract=off", "-lm")
"""Flags for a C file. Without contraction of products and sums the law has the same bits as in Python."""

OUT_OF_MEMORY = "out_of_memory"
"""Fault of a law that asked for more memory than it may have."""

STOPPED_WORDS = {
    "hung": "did not answer in time",
    "ended": "its process ended",
    OUT_OF_MEMORY: "asked for more memory than it may have",
    "not_finite": "answered no number",
    "velocity": "the joint became too fast",
    "not_loaded": "could not be loaded",
}
"""Why a foreign law was stopped, in words."""


@dataclass(frozen=True)
class ForeignLaw:
    """A file with somebody's law, and its checksum when it was read."""

    path: Path
    checksum: str

    @property
    def name(self) -> str:
        """Name of the law in the ranking."""
        return f"law:{self.path.name}"

    @classmethod
    def from_file(cls, path: str | Path) -> ForeignLaw:
        """Return the law of a file; refuse another ending."""
        path = Path(path).resolve()
        if path.suffix not in LAW_SUFFIXES or not path.is_file():
            raise PellucidError(f"{path}: found no law, expected a file that ends in {', '.join(LAW_SUFFIXES)}")
        return cls(path, checksum(path))


class ForeignController:
    """A foreign law as a controller of the knee orthosis, behind the safety gate; ``fault`` says why it was stopped."""

    def __init__(self, law: ForeignLaw, *, period: float, torque_limit: float) -> None:
        limits = Limits(
            effort=torque_limit, rate=RATE_LIMIT, velocity=VELOCITY_LIMIT, position=(-math.inf, math.inf),
            stop_margin=0.1,
        )  # fmt: skip
        self._gate = safety_gate(limits, period)
        self._period, self._count = period, 0
        self._positions: deque[float] = deque(maxlen=VELOCITY_SPAN + 1)
        self.fault = NO_FAULT
        self._folder = Path(tempfile.mkdtemp(prefix="pellucid-law-"))
        self._process: subprocess.Popen | None = None
        self._to = self._from = -1
        try:
            self._start(law)
        except _StoppedError as stopped:
            self._stop(stopped.why if stopped.why == OUT_OF_MEMORY else "not_loaded")

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the torque for the spring [N m]; `time` [s], `position` [rad], `torque` [N m]."""
        command = math.nan
        if self.fault == NO_FAULT:
            try:
                command = self._ask(0.0, time, position, torque)
            except _StoppedError as stopped:
                self._stop(stopped.why)
        self._positions.append(position)
        span = len(self._positions) - 1
        velocity = (position - self._positions[0]) / (span * self._period) if span else 0.0
        self._count += 1
        effort = self._gate.step(command, position, velocity, time, self._count)
        if self.fault == NO_FAULT and self._gate.fault != NO_FAULT:
            self._stop(self._gate.fault)
        return effort

    def close(self) -> None:
        """End the law's process and remove what was compiled."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            if self._process.stderr is not None:
                self._process.stderr.close()
            os.close(self._to)
            os.close(self._from)
            self._process = None
        shutil.rmtree(self._folder, ignore_errors=True)

    def _start(self, law: ForeignLaw) -> None:
        path = _compiled(law.path, self._folder) if law.path.suffix == ".c" else law.path
        inside, self._to = os.pipe()
        self._from, outside = os.pipe()
        command = [sys.executable, "-I", foreign_worker.__file__, str(path), str(inside), str(outside)]
        # The stranger's code gets no variable of its user but the path of programs.
        self._process = subprocess.Popen(
            [*command, str(MAX_MEMORY_BYTES)], pass_fds=(inside, outside), stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=self._folder,
            env={"PATH": os.defpath, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        os.close(inside)
        os.close(outside)
        if self._read(len(foreign_worker.READY_MESSAGE), MAX_LOAD_S) != foreign_worker.READY_MESSAGE:
            raise _StoppedError("not_loaded")
        self._ask(1.0, 0.0, 0.0, 0.0)

    def _ask(self, kind: float, *sample: float) -> float:
        try:
            os.write(self._to, foreign_worker.REQUEST_FORMAT.pack(kind, *sample))
        except OSError:
            raise _StoppedError(self._why_ended()) from None
        return foreign_worker.REPLY_FORMAT.unpack(self._read(foreign_worker.REPLY_FORMAT.size, MAX_STEP_S))[0]

    def _read(self, size: int, limit: float) -> bytes:
        poll = select.poll()
        poll.register(self._from, select.POLLIN)
        if not poll.poll(1e3 * limit):
            raise _StoppedError("hung")
        found = os.read(self._from, size)
        if len(found) < size:
            raise _StoppedError(self._why_ended())
        return found

    def _why_ended(self) -> str:
        if self._process is not None:
            try:
                self._process.wait(2.0)
            except subprocess.TimeoutExpired:
                return "hung"
        errors = b"" if self._process is None or self._process.stderr is None else self._process.stderr.read()
        return OUT_OF_MEMORY if b"MemoryError" in errors or b"bad_alloc" in errors else "ended"

    def _stop(self, why: str) -> None:
        self.fault = why
        if self._process is not None:
            self._process.kill()
            self._process.wait()


class _StoppedError(Exception):
    """A foreign law that is stopped, with the reason."""

    def __init__(self, why: str) -> None:
        super().__init__(why)
        self.why = why


def _compiled(source: Path, folder: Path) -> Path:
    """Compile a C file into a shared library."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        raise PellucidError(f"{source}: found no C compiler, expected cc, gcc or clang, or a shared library")
    library = folder / "law.so"
    try:
        subprocess.run([compiler, str(source), "-o", str(library), *COMPILER_FLAGS], check=True, timeout=MAX_LOAD_S,
                       stdin=subprocess.DEVNULL, capture_output=True)  # fmt: skip
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        raise _StoppedError("not_loaded") from None
    return library
