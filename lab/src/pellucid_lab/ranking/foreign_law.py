"""A user's control law in the ranking: a C file, a shared library or a Python class, in its own process.

The law receives the inputs of every law of the knee orthosis (time, the joint's position, the spring's torque) and
returns the desired torque of the spring. Its output passes the supervisor of every ranked controller (`watched_knee`).
A law is stopped if it exceeds its time or memory, ends, or returns a value that is not a number. Its torque then ramps
to 0, and the ranking lists the reason.
"""

from __future__ import annotations

import math
import os
import select
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pellucid._errors import PellucidError
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.study.study import checksum

from . import foreign_worker

LAW_SUFFIXES = (".c", ".so", ".py")
"""Endings of the files that hold a foreign law."""

MAX_MEMORY_BYTES = 2 * 1024**3
"""Address space of a foreign law's process. An interpreter with NumPy needs half a gigabyte of it."""

MAX_LOAD_S = 30.0
"""Longest time in which a law must be loaded, and in which a C file must be compiled."""

MAX_STEP_S = 2.0
"""Longest time for one answer. It is far longer than a control period, because the machine may be busy."""

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


class ForeignProcess:
    """One foreign law at work in a process of its own, at rest; `fault` says why it was stopped."""

    def __init__(self, law: ForeignLaw) -> None:
        self._law = law
        self.robots: tuple[str, ...] = ()  # robots for which the law has a function
        self._begin()

    def effort(self, robot: str, time: float, position: float, torque: float) -> float:
        """Return the effort that the law asks for on a robot of one joint [N m]; NaN once it was stopped."""
        return self.efforts(robot, time, (position,), (torque,))[0]

    def efforts(self, robot: str, time: float, position: Sequence[float], torque: Sequence[float]) -> tuple[float, ...]:
        """Return the effort that the law asks for at each joint of a robot [N m]; NaN once it was stopped.

        `time` [s]; `position` [rad] and `torque` [N m] have a number for each joint.
        """
        joints = foreign_worker.JOINT_COUNTS[robot]
        if self.fault != NO_FAULT:
            return (math.nan,) * joints
        unused = (0.0,) * (foreign_worker.MAX_JOINTS - joints)
        number = float(foreign_worker.ROBOT_NAMES.index(robot))
        try:
            answered = self._ask(number, time, *position, *unused, *torque, *unused)[:joints]
        except _StoppedError as stopped:
            self.stop(stopped.why)
            return (math.nan,) * joints
        if not all(map(math.isfinite, answered)):
            self.stop("not_finite")
        return answered

    def command_of(self, robot: str) -> Callable[[float, float, float], float]:
        """Return what gives the law's effort on a robot [N m] of time [s], angle [rad] and torque [N m].

        The law is reset whenever time begins anew, and is not asked without an angle.
        """
        last = math.inf

        def command(time: float, position: float, torque: float) -> float:
            nonlocal last
            if time < last:
                self.reset()
            last = time
            if not math.isfinite(position):
                return 0.0  # the supervisor stops a law without an encoder; nobody has to answer to it
            return self.effort(robot, time, position, torque)

        return command

    def reset(self) -> None:
        """Let the law forget everything; one that was stopped begins anew in another process."""
        if self.fault != NO_FAULT:
            self.close()
            self._begin()
            return
        try:
            self._reset()
        except _StoppedError as stopped:
            self.stop(stopped.why)

    def _begin(self) -> None:
        self.fault = NO_FAULT
        self._folder = Path(tempfile.mkdtemp(prefix="pellucid-law-"))
        self._process: subprocess.Popen | None = None
        self._to = self._from = -1
        try:
            self._start(self._law)
        except _StoppedError as stopped:
            self.stop(stopped.why if stopped.why == OUT_OF_MEMORY else "not_loaded")

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
        found = self._read(len(foreign_worker.ROBOT_NAMES), MAX_LOAD_S)
        self.robots = tuple(robot for robot, has in zip(foreign_worker.ROBOT_NAMES, found, strict=True) if has)
        self._reset()

    def _reset(self) -> None:
        self._ask(foreign_worker.RESET_REQUEST, *[0.0] * (1 + 2 * foreign_worker.MAX_JOINTS))

    def _ask(self, kind: float, *sample: float) -> tuple[float, ...]:
        try:
            os.write(self._to, foreign_worker.REQUEST_FORMAT.pack(kind, *sample))
        except OSError:
            raise _StoppedError(self._why_ended()) from None
        return foreign_worker.REPLY_FORMAT.unpack(self._read(foreign_worker.REPLY_FORMAT.size, MAX_STEP_S))

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

    def stop(self, why: str) -> None:
        """End the law's process for a reason."""
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


def stopped_words(fault: str) -> str:
    """Return in words why a foreign law was stopped."""
    return STOPPED_WORDS.get(fault, f"the supervisor found: {fault.replace('_', ' ')}")


def why_stopped(faults: Iterable[str]) -> tuple[str, ...]:
    """Return in words, once each, why a law was stopped in trials that ended with these faults."""
    return tuple(dict.fromkeys(stopped_words(fault) for fault in faults if fault != NO_FAULT))


class ForeignKneeLaw:
    """A foreign law as a controller of the knee orthosis, without a supervisor; `fault` says why it stopped."""

    def __init__(self, law: ForeignLaw) -> None:
        self._process = ForeignProcess(law)

    @property
    def fault(self) -> str:
        """Why the law was stopped."""
        return self._process.fault

    @property
    def robots(self) -> tuple[str, ...]:
        """Robots for which the law has a function."""
        return self._process.robots

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the torque that the law asks for [N m], 0 once it was stopped.

        `time` [s], `position` [rad], `torque` [N m]. The law gets no EMG.
        """
        command = self._process.effort("knee", time, position, torque)
        return command if math.isfinite(command) else 0.0

    def close(self) -> None:
        """End the law's process and remove what was compiled."""
        self._process.close()


class ForeignLaws:
    """Makes controllers of one foreign law, each with a process of its own, and ends them all: a context manager."""

    def __init__(self, law: ForeignLaw) -> None:
        self._law = law
        self._made: list[ForeignKneeLaw] = []

    def __enter__(self) -> Callable[[], ForeignKneeLaw]:
        return self._build

    def __exit__(self, *_: object) -> None:
        for one in self._made:
            one.close()

    def _build(self) -> ForeignKneeLaw:
        self._made.append(ForeignKneeLaw(self._law))
        return self._made[-1]
