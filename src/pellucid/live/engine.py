"""Start an engine with its recorder and streams, tell it what to do, and read what it does."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from .. import _atomic
from .._errors import PellucidError
from ..controllers.session_state import ENDED, SESSION_STATES, SILENT, SessionState
from ..controllers.supervisor_faults import FAULT_NAMES
from . import layout
from .clock_tracker import ClockState
from .intake import NAMES_WORD
from .recorder import NOTE_ENDING
from .replay import record_channels
from .setup import SESSION_VARIABLE, EngineSetup, Task, settings_text
from .shared_memory import (
    PRIVATE_MODE,
    PRIVATE_UMASK,
    SHARED_MEMORY_FOLDER,
    Event,
    Region,
    make_region_file,
    remove_dead_regions,
    remove_region,
)
from .stream_ring import StreamRing

ENGINE_NAME = "bin/pellucid-engine"
"""Path of the engine's program relative to the compiled core."""

SETTINGS_FILE = "engine.txt"
"""File in a session's folder that holds the engine's numbers."""

SESSION_FILE = "session.xdf"
"""File in a session's folder with every number that the law was given; a later session's has a number in its name."""

START_TIMEOUT_S = 20.0
"""Longest time that an engine may take to begin."""

COMMAND_TIMEOUT_S = 0.4
"""Longest time that an engine may take to see a command: shorter than the silence after which it stops its law."""

ENGINE_SILENCE_S = 0.05
"""An engine without a cycle for this time is silent [s]: 50 periods at 1 kHz. The pages then say so within 0.1 s."""

MAX_SILENT_PERIODS = 3
"""An engine with a long control period is silent only after more than this many periods without a cycle."""

RECORDER_SILENCE_S = 3.0
"""A recorder without a round for this time is silent [s]: a round takes 20 ms, but a slow disk may hold one up."""

END_TIMEOUT_S = 5.0
"""Longest time that a process may take to end in order."""

CHILD_NAMES = ("engine", "recorder", "intake", "streams")
"""Processes of a session in addition to the page server."""


@dataclass(frozen=True)
class EngineStatus:
    """What the engine says of itself now."""

    state: SessionState  # one of `SESSION_STATES`, or that the engine is lost
    condition: str
    fault: str  # latched fault of the supervisor, "none" for none
    mode: str  # what the supervisor does
    enable: bool  # whether the drive may have power
    challenge: int  # what a reset needs; 0 while all is well
    cycle: int
    time: float  # time of the last cycle on the monotonic clock [s]
    effort_limit: float  # effort limit of the chosen condition's law, 0 without one [N m]
    velocity_limit: float  # [rad/s]
    position_limits: tuple[float, float]  # [rad]


@dataclass(frozen=True)
class RecorderHealth:
    """Whether the recorder records."""

    problem: str  # why it does not record, after the words "the recorder"; empty while it records
    is_starting: bool = False


@dataclass(frozen=True)
class Samples:
    """Samples since a cursor: times on the host's monotonic clock, and arrays by channel in SI units."""

    cursor: int  # cursor from which to go on
    lost: int  # samples that were overwritten before they were read
    time: np.ndarray  # shape (n,) [s]
    channels: Mapping[str, np.ndarray]  # each shape (n,)


@dataclass(frozen=True)
class HeardStream:
    """One stream that was taken in."""

    silent_s: float  # time since something arrived [s]
    clock: ClockState


@dataclass(frozen=True)
class Health:
    """How well the engine keeps its deadlines, and what went wrong."""

    cycles: int
    late_cycles: int
    missed: int  # deadlines at which no cycle began
    worst_lateness: float  # [s]
    p99: float  # upper edge of the bin that holds the 99th percentile of lateness [s]
    jitter_edges: np.ndarray  # shape (k + 1,) [s]
    jitter_counts: np.ndarray  # shape (k,)
    fifo: bool  # whether the engine has the priority of real time
    locked: bool  # whether its memory is locked
    why_not: str  # why it has not, "" where it has both
    faults: tuple[tuple[float, str], ...]  # time [s] and name of each fault since the session began
    clocks: Mapping[str, ClockState]  # by stream


def engine_program() -> Path:
    """Return the engine's program.

    Raises
    ------
    PellucidError
        If this installation has none.
    """
    core = find_spec("pellucid._core")
    program = Path(core.origin if core is not None and core.origin else __file__).parent / ENGINE_NAME
    if not program.exists():
        raise PellucidError(f"{program}: found no engine; Pellucid installs it on Linux and macOS")
    return program


def next_session_file(folder: Path) -> Path:
    """Return the path for the next session's file in a folder: the first of session.xdf, session_2.xdf that is free."""
    path, number = folder / SESSION_FILE, 1
    while path.exists():
        number += 1
        path = folder / f"{Path(SESSION_FILE).stem}_{number}.xdf"
    return path


class LiveEngine:
    """A running engine with its recorder and streams.

    Make one with `start`. When the process that made it dies, engine, recorder and streams end by themselves.
    """

    def __init__(self, setup: EngineSetup, folder: Path, region: Region) -> None:
        self.setup = setup
        self.folder = folder
        self.region = region
        self.session_file = next_session_file(folder)
        self._processes: dict[str, subprocess.Popen] = {}
        self._torque_value = 0.0
        self._stop_sequence = 0  # number of the command with the last stop
        self._recorder_begun = 0  # when the recorder was started, on the monotonic clock [ns]
        self._felt_since = region.record_count
        self._faults: list[tuple[float, str]] = []
        self._fault_cursor = 0
        self._last_fault = 0

    # Life ------------------------------------------------------------------------------------------------------------

    @classmethod
    def start(
        cls,
        setup: EngineSetup,
        folder: str | Path,
        *,
        streams: bool = True,
        recorder: bool = True,
        ordinary: bool = False,
    ) -> Self:
        """Start the engine and its processes.

        Parameters
        ----------
        setup : EngineSetup
        folder : path
            For the files of the run; it is made.
        streams : bool
            Whether streams of the lab streaming layer are taken in, and those of a simulated wearer sent.
        recorder : bool
            Whether the recorder runs.
        ordinary : bool
            Whether the engine does not ask for the priority of real time, as in tests.

        Raises
        ------
        PellucidError
            If a process does not begin; the message says what it said.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        remove_dead_regions(SHARED_MEMORY_FOLDER, folder)
        path, handle = make_region_file(folder)
        try:
            region = Region.create(path, setup.period_ns)
        finally:
            os.close(handle)
        engine = cls(setup, folder, region)
        try:
            _atomic.write_bytes_atomically(folder / SETTINGS_FILE, settings_text(setup).encode(), private=True)
            engine._start_engine(ordinary)
            if recorder:
                engine.restart_recorder()
                engine._wait_for_recorder()
            if streams and setup.stream_types:
                engine._start_intake()
            if streams and setup.streams is not None:
                engine._start_streams()
        except BaseException:
            engine.close()
            raise
        return engine

    def _run(self, name: str, words: Sequence[object]) -> subprocess.Popen:
        # In a session of its own: a signal to the terminal's group leaves it running until it is told to end.
        try:
            log = os.open(self.folder / f"{name}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, PRIVATE_MODE)
        except OSError:  # such as a full disk: the process matters more than its words
            log = os.open(os.devnull, os.O_WRONLY)
        try:
            process = subprocess.Popen(
                [str(word) for word in words], stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
                env=os.environ | {SESSION_VARIABLE: str(os.getpid())}, umask=PRIVATE_UMASK,
            )  # fmt: skip
        finally:
            os.close(log)
        self._processes[name] = process
        return process

    def _start_engine(self, ordinary: bool) -> None:
        self._ordinary = ordinary
        self.region.command(run=0, end=0)
        begun = self.region.record_count
        words = [engine_program(), self.folder / SETTINGS_FILE, self.region.path, *(["--ordinary"] if ordinary else [])]
        process = self._run("engine", words)
        until = time.monotonic() + START_TIMEOUT_S
        while self.region.record_count == begun:
            if process.poll() is not None or time.monotonic() > until:
                raise PellucidError(self._last_words("engine") or "pellucid-engine: did not begin")
            time.sleep(0.005)
            self.beat()
        self._wait_for(self.region.command(run=0), START_TIMEOUT_S)

    def _last_words(self, name: str) -> str:
        try:
            said = (self.folder / f"{name}.log").read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""
        return said.splitlines()[-1] if said else ""

    def _start_module(self, name: str, *words: str) -> None:
        package = __package__ or "pellucid.live"
        self._run(name, [sys.executable, "-m", f"{package}.{name}", self.region.path, *words])

    def _start_intake(self) -> None:
        self._start_module("intake", *self.setup.stream_types, NAMES_WORD, *self.setup.stream_names)

    def _start_streams(self) -> None:
        program = self.setup.streams
        if program is not None:
            words = [sys.executable, "-m", program.module, self.region.path, json.dumps(dict(program.options))]
            self._run("streams", words)

    def restart_engine(self) -> None:
        """Start the engine again after it died; nothing is armed, and the condition is kept."""
        self._end("engine", signal.SIGKILL)
        self._start_engine(getattr(self, "_ordinary", False))

    def restart_recorder(self) -> None:
        """Start the recorder, or start it again; it goes on with the file that it was writing."""
        self._end("recorder", signal.SIGKILL)
        self._recorder_begun = time.monotonic_ns()
        self._start_module("recorder", str(self.session_file), str(self.folder / SETTINGS_FILE))

    def _wait_for_recorder(self) -> None:
        while (health := self.recorder_health()).problem:
            if not health.is_starting:
                raise PellucidError(f"the recorder {health.problem}")
            time.sleep(0.01)
            self.beat()

    def recorder_health(self) -> RecorderHealth:
        """Return whether the recorder records, and why not."""
        if "recorder" not in self._processes:
            return RecorderHealth("")
        told, status = self.region.recorder(), self._processes["recorder"].poll()
        if status is not None:
            if int(told["error"]):
                return RecorderHealth(f"has ended: {os.strerror(int(told['error']))}")
            by_signal = f"signal {-status}, {signal.strsignal(-status)}"
            said = by_signal if status < 0 else self._last_words("recorder") or f"status {status}"
            return RecorderHealth(f"has ended: {said}")
        now, heard = time.monotonic_ns(), int(told["heartbeat"])
        if heard < self._recorder_begun:
            late = now - self._recorder_begun > 1e9 * START_TIMEOUT_S
            return RecorderHealth("did not begin" if late else "is starting", not late)
        return RecorderHealth("is silent" if now - heard > 1e9 * RECORDER_SILENCE_S else "")

    def restart_streams(self) -> None:
        """Restart the intake and the streams of a simulated wearer if they have ended."""
        alive = self.alive
        if not alive.get("intake", True):
            self._start_intake()
        if not alive.get("streams", True):
            self._start_streams()

    @property
    def processes(self) -> dict[str, int]:
        """Process numbers by name."""
        return {name: process.pid for name, process in self._processes.items()}

    @property
    def alive(self) -> dict[str, bool]:
        """Whether each process that was started still runs, by name."""
        return {name: self._is_alive(name) for name in self._processes}

    def _is_alive(self, name: str) -> bool:
        return name in self._processes and self._processes[name].poll() is None

    def _end(self, name: str, how: int) -> None:
        if name not in self._processes:
            return
        process = self._processes[name]
        with suppress(ProcessLookupError):
            process.send_signal(how)
        try:
            process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def close(self) -> None:
        """End every process in order: open recordings are sealed, and the robot has no power."""
        self.region.command(run=0, end=1)
        for name in CHILD_NAMES:
            self._end(name, signal.SIGTERM)
        remove_region(self.region.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # Telling ---------------------------------------------------------------------------------------------------------

    def beat(self) -> None:
        """Say that the session is alive; to be called at least three times a second."""
        self.region.command()

    def _wait_for(self, sequence: int, timeout: float = COMMAND_TIMEOUT_S) -> None:
        until = time.monotonic() + timeout
        while not self._has_seen(sequence):
            if time.monotonic() > until:
                raise PellucidError(f"engine: found no response to a command within {timeout:g} s; check its process")
            time.sleep(0.001)

    def _has_seen(self, sequence: int) -> bool:
        return int(self.region.status()["command_sequence"]) >= sequence

    def set_condition(self, condition: str | int) -> None:
        """Choose a condition; a law that runs is first ramped to no effort."""
        self._torque_value = 0.0
        self.region.command(law=self.setup.condition_index(condition))

    def arm(self) -> None:
        """Let the condition's law run; without a law nothing happens."""
        if not self.region.last_command()["run"]:
            # The engine arms on a change from disarmed to armed that it has seen.
            self._wait_for(self.region.command(run=0))
        self.region.command(run=1, token=0)

    def disarm(self) -> None:
        """Ramp the effort to 0 and take the power off."""
        self.region.command(run=0)

    def stop(self) -> None:
        """Stop as the operator: the supervisor stops the law and latches. A reset that was requested before is void."""
        self._stop_sequence = self.region.command(stops=int(self.region.last_command()["stops"]) + 1, token=0)

    def reset(self) -> None:
        """Ask for a reset after a stop; it is granted after a healthy while, and the law is then disarmed.

        To be called again until the engine is no longer stopped: nothing is asked before the engine has seen the stop.
        """
        if self._has_seen(self._stop_sequence):
            self.region.command(run=0, token=int(self.region.status()["challenge"]))

    def set_torque(self, torque: float) -> None:
        """Change the torque that the running law adds [N m]; its gate limits size and rate.

        Raises
        ------
        PellucidError
            If the condition's law has no number "offset".
        """
        index = int(self.region.last_command()["law"])
        field = self.setup.conditions[index].field_index("offset")
        last = self.region.last_command()
        self._torque_value = float(torque)
        self.region.command(
            adjusts=int(last["adjusts"]) + 1, adjusted_field=field, adjusted_law=index, adjusted_value=float(torque)
        )

    def set_estimate(self, torque: float, half_width: float) -> None:
        """Keep in the records what the robot's torque on the person is by EMG, and half of its interval [N m].

        The law does not read it. NaN where there is none.
        """
        self.region.command(torque_estimate=float(torque), torque_half_width=float(half_width))

    def inject(self, fault: str, seconds: float) -> None:
        """Put a fault of `layout.INJECTION_KINDS` into the inputs for a time [s]: for tests of the whole chain."""
        count = int(self.region.last_command()["injections"]) + 1
        self.region.command(injections=count, injection=layout.INJECTION_KINDS.index(fault), injected_for=seconds)

    # Tasks of a simulated wearer --------------------------------------------------------------------------------------

    def _give(self, task: Task) -> None:
        self.region.command(
            task=int(self.region.last_command()["task"]) + 1,
            task_kind=layout.TASK_KINDS.index(task.kind),
            target=task.target,
            amplitude=task.amplitude,
            duration=task.duration,
            reaction=task.reaction,
            frequency=task.frequency,
            share=task.share,
            load=task.load,
        )

    def set_target(self, target: float, reaction: float | None = None) -> None:
        """Show a target [rad]; a simulated wearer reaches for it after a `reaction` time [s], sampled if None."""
        _, records, _ = self.region.records_since(self._felt_since)
        self._felt_since = self.region.record_count
        task = Task("reach", float(target))
        if self.setup.wearer is not None and len(records):
            felt = {
                "position": records["limb_position"],
                "velocity": records["limb_velocity"],
                "interaction": records["value"][:, 2],
            }
            worn = self.setup.conditions[int(records["law"][-1])].worn
            task = self.setup.wearer.reach(float(target), float(records["limb_position"][-1]), felt, worn)
        if reaction is not None:
            task = Task(**{**vars(task), "reaction": float(reaction)})
        self._give(task)

    def set_tracking(self, centre: float, amplitude: float, frequency: float) -> None:
        """Show a target that moves as a sine about a centre [rad] with an amplitude [rad] and a frequency [Hz]."""
        self._give(Task("track", float(centre), amplitude=float(amplitude), frequency=float(frequency)))

    def set_contraction(self, share: float) -> None:
        """Ask for a contraction with a share of the strength, positive flexes [1]; a frame holds the limb until 0."""
        self._give(Task("contract", float(self.region.last_command()["target"]), share=float(share)))

    # Recording and events --------------------------------------------------------------------------------------------

    def mark(self, kind: str, data: Mapping[str, Any] | None = None, time_s: float | None = None) -> None:
        """Record an event with a kind and data that JSON can hold."""
        self.region.write_event(kind, data, time_s)

    def events_since(self, cursor: int) -> tuple[int, list[Event]]:
        """Return the next cursor and the events after a cursor; 0 is before the first."""
        return self.region.events_since(cursor)

    def begin_recording(self, path: str | Path, about: Mapping[str, Any] | None = None) -> None:
        """Record into a new file from now on; `about` is kept in it (texts are split over its parts)."""
        path = Path(path).resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        note = path.with_suffix(NOTE_ENDING)
        conditions = [c.name for c in self.setup.conditions]
        said = json.dumps({"conditions": conditions, **(about or {})})
        _atomic.write_bytes_atomically(note, said.encode(), private=True)
        self.region.write_event("record_begin", {"path": str(path), "about": str(note)})
        self._recorded = path

    def end_recording(self, *, wait: bool = True, timeout: float = 5.0) -> Path:
        """End the recording, and return its file, which is whole once `recorded` says so.

        Raises
        ------
        PellucidError
            If the recorder does not seal the file within the `timeout` [s].
        """
        path: Path = self._recorded
        self.region.write_event("record_end", {"path": str(path)})
        until = time.monotonic() + timeout
        while wait and not self.recorded(path):
            if time.monotonic() > until:
                raise PellucidError(
                    f"{path}: the recorder did not complete the file within {timeout} s; check the free space of its "
                    "disk"
                )
            self.beat()
            time.sleep(0.01)
        return path

    def recorded(self, path: str | Path) -> bool:
        """Whether a recording has its end: the recorder then has nothing more to write."""
        path = Path(path)
        return path.exists() and not path.with_suffix(NOTE_ENDING).exists()

    def give_up_recording(self, path: str | Path) -> None:
        """Take a recording from a recorder that does not seal its file; the file stays as it is.

        The recorder is ended; `restart_recorder` starts it again.
        """
        self._end("recorder", signal.SIGKILL)
        with suppress(OSError):
            Path(path).with_suffix(".about.json").unlink(missing_ok=True)

    # Reading ---------------------------------------------------------------------------------------------------------

    def status(self) -> EngineStatus:
        """Return what the engine says of itself now."""
        s = self.region.status()
        has_ended = bool(s["ended"]) or not self._is_alive("engine")
        patience = max(ENGINE_SILENCE_S, MAX_SILENT_PERIODS * self.setup.period)
        is_silent = time.monotonic_ns() - int(s["heartbeat"]) > 1e9 * patience
        return EngineStatus(
            state=ENDED if has_ended else SILENT if is_silent else SESSION_STATES[int(s["state"])],
            condition=self.setup.conditions[int(s["law"])].name,
            fault=FAULT_NAMES[int(s["fault"])],
            mode=layout.MODES[int(s["mode"])],
            enable=bool(s["enable"]),
            challenge=int(s["challenge"]),
            cycle=int(s["cycle"]),
            time=1e-9 * int(s["heartbeat"]),
            effort_limit=float(s["effort_limit"]),
            velocity_limit=float(s["velocity_limit"]),
            position_limits=(float(s["position_min"]), float(s["position_max"])),
        )

    def read_since(self, cursor: int, *, every: int = 1, limit: int | None = None) -> Samples:
        """Return the samples after a `cursor`, or `every` so many of them; 0 is before the first."""
        cursor, records, lost = self.region.records_since(cursor, limit)
        return Samples(cursor, lost, 1e-9 * records["time"][::every], record_channels(records[::every]))

    @property
    def emg(self) -> StreamRing | None:
        """The stream of EMG that was taken in, or None while there is none."""
        return next((ring for ring in self.streams if ring.type == "EMG"), None)

    @property
    def streams(self) -> list[StreamRing]:
        """All streams that were taken in so far."""
        return StreamRing.all_of(self.region.path)

    def heard_streams(self) -> dict[str, HeardStream]:
        """Return when each stream was heard last, and what is known of its clock, by its name."""
        now = time.monotonic_ns()
        return {ring.name: HeardStream(1e-9 * (now - ring.heard_ns), ring.clock) for ring in self.streams}

    def health(self) -> Health:
        """Return how well the engine keeps its deadlines, and all faults so far."""
        s = self.region.status()
        counts, edges = s["lateness"].astype(np.int64), layout.lateness_edges()
        total = np.cumsum(counts)
        p99 = float(edges[1:][np.searchsorted(total, 0.99 * total[-1])]) if total[-1] else 0.0
        refused = [
            f"{what}: {os.strerror(int(s[error])) if int(s[error]) != errno.ECANCELED else 'not asked for'}"
            for what, granted, error in (("SCHED_FIFO", "fifo", "fifo_error"), ("mlockall", "locked", "lock_error"))
            if not s[granted]
        ]
        self._fault_cursor, records, _ = self.region.records_since(self._fault_cursor)
        codes = records["fault"].astype(int)
        begins = np.flatnonzero(np.diff(codes, prepend=self._last_fault))
        self._faults += [(1e-9 * int(records["time"][i]), FAULT_NAMES[codes[i]]) for i in begins if codes[i]]
        self._last_fault = int(codes[-1]) if len(codes) else self._last_fault
        return Health(
            cycles=int(counts.sum()),
            late_cycles=int(s["late"]),
            missed=int(s["missed"]),
            worst_lateness=1e-9 * int(s["worst_lateness"]),
            p99=p99,
            jitter_edges=edges,
            jitter_counts=counts,
            fifo=bool(s["fifo"]),
            locked=bool(s["locked"]),
            why_not="; ".join(refused),
            faults=tuple(self._faults),
            clocks={ring.name: ring.clock for ring in self.streams},
        )
