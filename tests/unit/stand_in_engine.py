"""An engine for tests of the session: a person who goes where they are asked to, on a clock that the test moves on."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from test_xdf import stream, write

from pellucid.controllers.session_state import ENDED, SESSION_STATES, SILENT
from pellucid.emg.study.emg_torque.relative_envelopes import FLEXOR_NAME_PARTS

RATE_HZ = 200.0
"""Rate of the stand-in's robot [Hz]; slower than a robot's, so that tests are quick."""

EMG_RATE_HZ = 1024.0
REACH_S = 0.7
"""Time in which the person reaches a target [s]."""

MUSCLES = ("biceps", "brachioradialis", "triceps_long", "triceps_lateral")


STATES = {state.name: state for state in (*SESSION_STATES, SILENT, ENDED)}


@dataclass
class Clock:
    """A monotonic clock that a test moves on."""

    now: float = 1000.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Samples:
    cursor: int
    lost: int
    time: np.ndarray
    channels: dict[str, np.ndarray]


@dataclass
class StandInEngine:
    """Answers as `pellucid.live.LiveEngine` does."""

    clock: Clock
    law: str = "Ctrl"
    muscles: tuple[str, ...] = MUSCLES
    state: str = "disarmed"
    fault: str = "none"
    freeze: bool = False  # the encoder's angle no longer changes
    late: tuple[int, int] | None = None  # of every so many cycles of a recording, so many are lost in a row
    alive: dict = field(default_factory=lambda: {"engine": True, "recorder": True})

    def __post_init__(self):
        self.begun = self.clock.now
        self.rows: list[tuple[float, ...]] = []
        self.emg_samples, self.emg_count = np.zeros((200_000, len(self.muscles)), np.float32), 0
        self.angle, self.start, self.target, self.asked_at = 1.0, 1.0, 1.0, self.clock.now
        self.tracking = None
        self.share, self.torque = 0.0, 0.0
        self.events: list[tuple[float, str, dict]] = []
        self.recording: tuple[Path, int, int] | None = None
        self.rng = np.random.default_rng(5)
        self.emg = SimpleNamespace(
            read_since=self._read_emg, labels=[f"emg.{m}" for m in self.muscles], nominal_rate=EMG_RATE_HZ
        )
        self.beats = 0
        self.problem, self.heals, self.restarts, self.given_up = "has ended: No space left on device", True, 0, []
        self.estimates: list[tuple[float, float, float]] = []
        self.silent = {"emg": 0.0, "markers": 0.0, "encoder": 0.0}
        self.clocks = {name: SimpleNamespace(jumps=0, batches=0, lost=0) for name in self.silent}

    # What the person does.

    def _grow(self) -> None:
        while self.begun + len(self.rows) / RATE_HZ <= self.clock.now:
            t = self.begun + len(self.rows) / RATE_HZ
            s = np.clip((t - self.asked_at - 0.2) / REACH_S, 0.0, 1.0)
            angle = self.start + (self.target - self.start) * (10 * s**3 - 15 * s**4 + 6 * s**5)
            if self.tracking is not None:
                centre, amplitude, frequency, since = self.tracking
                angle = centre + amplitude * np.sin(2 * np.pi * frequency * (t - since))
            angle += 0.0004 * self.rng.standard_normal()
            before = self.rows[-1][1] if self.rows else angle
            angle = before if self.freeze else angle
            velocity = (angle - before) * RATE_HZ
            asked = angle if self.tracking is not None else self.target
            force = -self.torque - 0.5 * np.sign(velocity) + 0.05 * self.rng.standard_normal()
            self.rows.append((t, angle, velocity, self.torque, force, asked))
            self.angle = angle

    def _grow_emg(self) -> None:
        """Samples up to now, of the pull that was asked for until now."""
        wanted = int((self.clock.now - self.begun) * EMG_RATE_HZ)
        new = wanted - self.emg_count
        if wanted > len(self.emg_samples):
            self.emg_samples = np.concatenate([self.emg_samples, np.zeros_like(self.emg_samples)])
        if new > 0:
            flexes = -self.torque / 10.0 + self.share  # the person counters the robot; positive flexes
            signs = np.array([1.0 if any(part in m for part in FLEXOR_NAME_PARTS) else -1.0 for m in self.muscles])
            pull = 1e-3 * (np.maximum(flexes * signs, 0.0) + 0.02)
            self.emg_samples[self.emg_count : wanted] = pull * self.rng.standard_normal((new, len(self.muscles)))
            self.emg_count = wanted

    def _read_emg(self, cursor: int) -> SimpleNamespace:
        self._grow_emg()
        values = self.emg_samples[cursor : self.emg_count]
        time = self.begun + (cursor + np.arange(len(values))) / EMG_RATE_HZ
        return SimpleNamespace(cursor=self.emg_count, lost=0, time=time, values=values)

    # The engine's functions.

    def beat(self):
        self.beats += 1

    def status(self):
        return SimpleNamespace(
            state=STATES[self.state], condition=self.law, fault=self.fault, effort_limit=12.0, velocity_limit=5.0,
            position_limits=(0.0, 2.6),
        )  # fmt: skip

    def set_condition(self, name):
        self.law = name

    def arm(self):
        self.state = "running"

    def disarm(self):
        self.state = self.state if self.state in ("stopped", "silent") else "disarmed"

    def stop(self):
        self.state, self.fault = "stopped", "operator"

    def reset(self):
        self.state, self.fault = "disarmed", "none"

    def read_since(self, cursor, every=1, limit=None):
        self._grow()
        rows = np.array(self.rows[cursor::every]).reshape(-1, 6)
        names = ("position", "velocity", "torque", "interaction", "target")
        channels = {name: rows[:, i + 1] for i, name in enumerate(names)}
        channels["limb"] = channels["position"]
        return Samples(len(self.rows), 0, rows[:, 0], channels)

    def set_target(self, angle):
        self._grow()
        self.start, self.target, self.asked_at, self.tracking = self.angle, angle, self.clock.now, None

    def set_tracking(self, centre, amplitude, frequency):
        self.tracking = (centre, amplitude, frequency, self.clock.now)

    def set_contraction(self, share):
        self._grow_emg()
        self.share = share

    def set_torque(self, torque):
        self._grow_emg()
        self._grow()
        self.torque = torque

    def set_estimate(self, torque, half_width):
        self.estimates.append((self.clock.now, torque, half_width))

    def heard_streams(self):
        return {name: SimpleNamespace(silent_s=silent, clock=self.clocks[name]) for name, silent in self.silent.items()}

    def mark(self, kind, data=None, time=None):
        assert len(json.dumps(data)) < 3900
        self.events.append((self.clock.now, kind, data))

    def begin_recording(self, path, about):
        self._grow()
        self._grow_emg()
        self.recording = (Path(path), len(self.rows), self.emg_count)

    def end_recording(self, wait=True):
        self._grow()
        self._grow_emg()
        path, first, first_emg = self.recording
        first, first_emg = min(first, len(self.rows) - 1), min(first_emg, self.emg_count - 1)
        rows = np.array(self.rows[first:])
        if self.late is not None:
            every, lost = self.late
            rows = rows[np.arange(len(rows)) % every >= lost]
        emg = self.emg_samples[first_emg : self.emg_count]
        times = self.begun + (first_emg + np.arange(len(emg))) / EMG_RATE_HZ
        names, values = ["position", "velocity", "torque", "interaction", "target", "limb"], rows[:, [1, 2, 3, 4, 5, 1]]
        write(
            path,
            # Without a nominal rate stamps are read as they are; with one, pyxdf smooths them over lost cycles.
            stream(1, "robot", RATE_HZ if self.late is None else 0.0, rows[:, 0], values, names, [""] * 6),
            stream(2, "emg", EMG_RATE_HZ, times, emg, list(self.muscles), ["volts"] * len(self.muscles)),
        )
        return path

    def recorder_health(self):
        problem = "" if self.alive["recorder"] else self.problem
        return SimpleNamespace(problem=problem, is_starting=False)

    def restart_recorder(self):
        self.restarts += 1
        self.alive["recorder"] = self.heals

    def give_up_recording(self, path):
        self.given_up.append(path)

    def recorded(self, path):
        return Path(path).is_file() and self.alive["recorder"]

    def health(self):
        return SimpleNamespace(
            cycles=len(self.rows), late_cycles=0, missed=0, worst_lateness=1e-4, p99=6e-5,
            jitter_edges=np.linspace(0, 1e-3, 21), jitter_counts=np.zeros(20, int), fifo=False, locked=False,
            why_not="a stand-in", faults=[], clocks={},
        )  # fmt: skip
